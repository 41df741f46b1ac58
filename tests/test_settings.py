"""Settings: every value is either meant, or refused by name."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from aobake import BakeSettings, SettingsError, StoreSettings
from aobake.cli.options import field_help
from aobake.settings import (
    AtlasSettings,
    ImageSettings,
    TraceSettings,
    VertexSettings,
)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rays", 0),
        ("rays", -1),
        ("rays", 2**21),
        ("rays", 2.5),
        ("rays", True),
        ("rays", "256"),
        ("rays", None),
        ("max_rays", 0),
        ("max_hole", 2),
        ("repair", 1),
        ("seed", -1),
        ("seed", 2**64),
        ("threads", 0),
        ("threads", 1.0),
        ("tolerance", 0.0),
        ("tolerance", -0.01),
        ("tolerance", 0.6),
        ("tolerance", math.nan),
        ("tolerance", "0.01"),
        ("tolerance", "rms:"),
        ("tolerance", "rms:0"),
        ("tolerance", "rms:0.6"),
        ("tolerance", "each:0.01"),
        ("tolerance_of", "all"),
        ("quality", "best"),
        ("max_distance", 0.0),
        ("max_distance", -1.0),
        ("max_distance", math.inf),
        ("max_distance", math.nan),
        ("falloff", "liner"),
        ("falloff", None),
        ("backfaces", "never"),
        ("ground", "y"),
        ("method", "best"),
    ],
)
def test_a_value_without_meaning_is_refused_by_name(field: str, value: object) -> None:
    wrong: dict[str, Any] = {field: value}
    with pytest.raises(SettingsError) as caught:
        BakeSettings(**wrong)
    message = str(caught.value)
    assert message.startswith(f"{field} is ")
    assert "\n" not in message


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rays", 1),
        ("rays", 2**20),
        ("rays", np.int64(64)),
        ("seed", 2**64 - 1),
        ("threads", 1),
        ("tolerance", 0.5),
        ("tolerance", np.float32(0.01)),
        ("max_distance", 1e-300),
        ("max_distance", 3),
        ("ground", "+z"),
    ],
)
def test_a_value_at_the_edge_of_its_meaning_is_taken(field: str, value: object) -> None:
    right: dict[str, Any] = {field: value}
    assert getattr(BakeSettings(**right), field) == value


def test_a_tolerance_for_all_points_is_said_in_one_word() -> None:
    together: dict[str, Any] = {"tolerance": "rms:0.01"}
    settings = BakeSettings(**together)
    assert (settings.tolerance, settings.tolerance_of) == (0.01, "rms")
    assert BakeSettings(tolerance=0.01).tolerance_of == "each"
    assert settings == BakeSettings(tolerance=0.01, tolerance_of="rms")


def test_a_quality_is_a_tolerance_by_name_and_a_tolerance_has_the_last_word() -> None:
    assert BakeSettings(quality="draft").tolerance == 0.02
    assert BakeSettings(quality="normal").tolerance == 0.005
    assert BakeSettings(quality="final").tolerance == 0.002
    assert BakeSettings(quality="final", tolerance=0.1).tolerance == 0.1


def test_a_tolerance_needs_room_for_its_first_round() -> None:
    assert BakeSettings(max_rays=1).max_rays == 1
    with pytest.raises(SettingsError, match="max_rays is 31"):
        BakeSettings(tolerance=0.01, max_rays=31)


def test_a_falloff_needs_a_distance_to_fall_off_over() -> None:
    with pytest.raises(SettingsError, match="max_distance"):
        BakeSettings(falloff="linear")
    assert BakeSettings(falloff="linear", max_distance=2.0).falloff == "linear"


def test_a_wrong_choice_is_answered_with_the_nearest_one() -> None:
    wrong: dict[str, Any] = {"store": "colour"}
    with pytest.raises(SettingsError, match='Did you mean "color"'):
        StoreSettings(**wrong)


def test_settings_cannot_be_changed_after_they_were_checked() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        BakeSettings().rays = 0  # type: ignore[misc]


@pytest.mark.parametrize(
    "kind", [TraceSettings, VertexSettings, AtlasSettings, StoreSettings, ImageSettings]
)
def test_every_setting_explains_itself(kind: type) -> None:
    assert set(field_help(kind)) == {field.name for field in dataclasses.fields(kind)}

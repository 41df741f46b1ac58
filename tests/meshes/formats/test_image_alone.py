"""The images of a lightmap without an asset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.images import decode
from aobake.meshes.formats import check_texture_target
from aobake.meshes.lightmap import Kept
from aobake.meshes.scene import Scene
from aobake.settings import ImageSettings
from tests.meshes.formats.lightmaps import explode_all, lightmap, page, write

TRIANGLE = Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("name", "encoding", "step"),
    [("a.png", "8", 1 / 255), ("a.exr", "float", 0.0), ("a.tif", "half", 2.0**-11)],
)
def test_the_values_come_back(tmp_path: Path, name: str, encoding: Any, step: float) -> None:
    values = np.random.default_rng(1).random((5, 7), np.float32)
    found = lightmap(Kept(uv_set=0), pages=(values,))
    written = write(TRIANGLE, found, tmp_path / name, ImageSettings(encoding=encoding))
    assert written == (tmp_path / name,)
    image = decode(written[0].read_bytes(), name)
    np.testing.assert_allclose(image[:, :, 0], values, rtol=0, atol=step)


def test_several_images_are_numbered(tmp_path: Path) -> None:
    found = lightmap(Kept(uv_set=0), pages=(page(0), page(1)))
    written = write(TRIANGLE, found, tmp_path / "a.png")
    assert [path.name for path in written] == ["a.png", "a_2.png"]
    first, second = (decode(path.read_bytes(), path.name) for path in written)
    assert not np.array_equal(first, second)


def test_new_coordinates_are_warned_of_since_no_image_holds_them(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    assert check_texture_target(TRIANGLE, target, ImageSettings()) == ()
    (note,) = check_texture_target(TRIANGLE, target, ImageSettings(), explode_all(TRIANGLE))
    assert "only an asset can hold" in note


@pytest.mark.parametrize(("name", "encoding"), [("a.png", "half"), ("a.exr", "8")])
def test_an_encoding_that_the_image_cannot_hold_is_refused_before_the_bake(
    tmp_path: Path, name: str, encoding: Any
) -> None:
    with pytest.raises(OutputError, match="cannot hold the encoding") as caught:
        check_texture_target(TRIANGLE, tmp_path / name, ImageSettings(encoding=encoding))
    assert "\n" not in str(caught.value)

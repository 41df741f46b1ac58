"""The settings of a batch are checked when they are made."""

from __future__ import annotations

import re
from typing import Any

import pytest

from aobake import SettingsError
from aobake.batch.settings import BatchSettings


@pytest.mark.parametrize(
    ("words", "size"),
    [
        (None, None),
        ("4GB", 4 * 10**9),
        ("4 GiB", 4 * 2**30),
        ("512MiB", 512 * 2**20),
        ("1.5g", 1_500_000_000),
        ("2T", 2 * 10**12),
        ("100000000", 10**8),
        ("100000000B", 10**8),
    ],
)
def test_memory_is_read_as_people_write_it(words: str | None, size: int | None) -> None:
    assert BatchSettings(memory_per_job=words).memory_bytes == size


def test_words_are_brought_into_one_form() -> None:
    chosen: Any = BatchSettings
    assert chosen(bake=["texture", "vertex", "vertex"]).bake == ("vertex", "texture")
    assert chosen(bake="texture", format=".GLB").bake == ("texture",)
    assert chosen(format=".GLB").format == "glb"
    assert chosen(only="*.glb", skip=["a/", "b"]).only == ("*.glb",)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"bake": ()}, "bake is ()"),
        ({"bake": ("vertx",)}, "bake is 'vertx'. Did you mean \"vertex\"?"),
        ({"bake": 3}, "bake is 3"),
        ({"format": "../a"}, "format is '../a'"),
        ({"format": 3}, "format is 3"),
        ({"preset": 3}, "preset is 3"),
        ({"only": ("../*",)}, "only '../*' leaves its folder"),
        ({"skip": ("",)}, "skip '' names nothing"),
        ({"skip": 3}, "skip is 3"),
        ({"processes": 0}, "processes is 0"),
        ({"processes": 2.0}, "processes is 2.0"),
        ({"processes": True}, "processes is True"),
        ({"memory_per_job": "4"}, "at least 64 MiB"),
        ({"memory_per_job": "lots"}, "such as 4GB"),
        ({"memory_per_job": "-4GB"}, "such as 4GB"),
        ({"memory_per_job": "9" * 50 + "GB"}, "such as 4GB"),
        ({"memory_per_job": 4}, "such as 4GB"),
        ({"timeout": 0.0}, "seconds above 0"),
        ({"timeout": float("nan")}, "timeout is nan"),
        ({"timeout": float("inf")}, "timeout is inf"),
        ({"timeout": "10"}, "timeout is '10'"),
        ({"retries": -1}, "retries is -1"),
        ({"grace": -1.0}, "grace is -1.0"),
        ({"grace": True}, "grace is True"),
        ({"pictures": "all"}, "pictures is 'all'"),
        ({"tiles": True}, "tiles is True"),
    ],
)
def test_what_has_no_meaning_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(message)) as caught:
        BatchSettings(**wrong)
    assert str(caught.value).startswith(next(iter(wrong)))


def test_no_grace_at_all_is_a_grace() -> None:
    assert BatchSettings(grace=0.0).grace == 0.0

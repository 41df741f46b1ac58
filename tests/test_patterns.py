"""Patterns of file names: the rules of .editorconfig, an oracle, and nothing that takes long."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aobake import SettingsError
from aobake.patterns import pattern


@pytest.mark.parametrize(
    ("words", "fitting", "others"),
    [
        ("*.glb", ["a.glb", "props/a.glb", ".glb"], ["a.gltf", "A.GLB", "a.glb/b.obj"]),
        ("/*.glb", ["a.glb"], ["props/a.glb"]),
        ("props/*.glb", ["props/a.glb"], ["a.glb", "props/old/a.glb", "x/props/a.glb"]),
        ("props/**/*.glb", ["props/a.glb", "props/x/y/a.glb"], ["a.glb", "props2/a.glb"]),
        ("**/old/*", ["old/a", "x/old/a"], ["old", "old/x/a"]),
        ("props/**", ["props/a", "props/x/a"], ["props", "x/props/a"]),
        ("props/", ["props/a", "x/props/y/a"], ["props", "props2/a"]),
        ("/props/", ["props/a", "props/x/a"], ["x/props/a"]),
        ("**", ["a", "x/y/a"], []),
        ("a?[0-9].obj", ["ab1.obj"], ["a1.obj", "abb.obj"]),
        ("[{]a}.obj", ["{a}.obj"], ["a.obj"]),
        ("a\nb.obj", ["a\nb.obj"], ["a b.obj"]),
        ("**/a/**/a/**/b", ["a/a/b", "a/x/a/a/b"], ["a/b", "a/a/c"]),
    ],
)
def test_a_pattern_fits_what_it_says(words: str, fitting: list[str], others: list[str]) -> None:
    assert [name for name in fitting if not pattern(words).fits(name)] == []
    assert [name for name in others if pattern(words).fits(name)] == []


@pytest.mark.parametrize(
    ("words", "folder", "taken"),
    [
        ("old", "props/old", True),
        ("old/", "props/old", True),
        ("props/**", "props", True),
        ("props/**", "props/old", True),
        ("props/*.glb", "props", False),
        ("*.glb", "props", False),
    ],
)
def test_a_folder_is_taken_with_everything_below_it(words: str, folder: str, taken: bool) -> None:
    assert pattern(words).takes(folder) is taken


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        ("", "names nothing"),
        ("/", "names nothing"),
        ("a//b", "names nothing"),
        ("../a.glb", "leaves its folder"),
        ("a/../../b", "leaves its folder"),
        ("./a", "leaves its folder"),
        ("a\\b", "Write /"),
        ("*.{glb,obj}", "several patterns"),
    ],
)
def test_what_is_no_pattern_is_refused_with_the_cure(words: str, cure: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(cure)) as caught:
        pattern(words)
    assert str(caught.value).startswith(repr(words))


def slow(words: str) -> re.Pattern[str]:
    """The same rules as one regular expression, which may go back as often as it likes."""
    whole = words if "/" in words else f"**/{words}"
    text = ""
    for part in whole.lstrip("/").split("/"):
        letters = {"*": "[^/]*", "?": "[^/]"}
        text += "(?:[^/]+/)*" if part == "**" else "".join(letters.get(c, c) for c in part) + "/"
    return re.compile(text[:-1] if text.endswith("/") else f"{text}[^/]+")


PARTS = st.lists(st.sampled_from(["**", "*", "a", "b", "a*", "?", "*b"]), min_size=1, max_size=5)
NAMES = st.lists(st.sampled_from(["a", "b", "ab", "ba"]), min_size=1, max_size=6)


@given(PARTS, NAMES)
def test_it_is_what_a_slow_regular_expression_says(parts: list[str], name: list[str]) -> None:
    words, path = "/".join(parts), "/".join(name)
    assert pattern(words).fits(path) == bool(slow(words).fullmatch(path)), (words, path)


def test_no_pattern_takes_long() -> None:
    """Both would take years if every * and ** were tried at every place."""
    assert not pattern("*a" * 60 + "b").fits("a" * 250)
    assert not pattern("**/a/" * 60 + "b").fits("/".join(["a"] * 2000))

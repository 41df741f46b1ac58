"""Embree's C interface: found, and missed with a cure."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator

import numpy as np
import pytest

from aobake import EngineError
from aobake.tracing import embree
from tests.scenes import box
from tests.tracing.rays import occluded


@pytest.fixture
def anew() -> Iterator[None]:
    """The library looked up once more, before and after."""
    embree._library.cache_clear()
    yield
    embree._library.cache_clear()


def test_embree_has_a_version_and_addresses() -> None:
    assert re.fullmatch(r"4\.\d+\.\d+", embree.version())
    found = embree.functions()
    assert min(found.occluded8, found.intersect8, found.point_query) > 0


def test_without_embreex_the_error_names_the_cure(
    anew: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda *_: None)
    with pytest.raises(EngineError, match="pip install embreex") as caught:
        embree._library()
    assert "\n" not in str(caught.value)


def test_a_library_that_is_none_gives_one_line(anew: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "_library_path", lambda: __file__)
    with pytest.raises(EngineError, match="Reinstall it") as caught:
        embree._library()
    assert "\n" not in str(caught.value)


def test_a_tree_of_nothing_is_open() -> None:
    tree = embree.build_tree([], [], [])
    rays = np.ones((9, 3), np.float32)
    assert not occluded(tree, rays, rays).any()


def test_a_tree_outlives_the_arrays_it_was_built_from() -> None:
    """Embree shares the buffers: the tree has to keep them."""

    def built() -> embree.Tree:
        vertices = np.zeros((12, 3), np.float32)
        vertices[:8] = box().vertices
        return embree.build_tree([embree.Body(vertices[:8], box().faces.astype(np.uint32))], [], [])

    tree = built()
    np.zeros(1_000_000).fill(1.0)
    directions = np.random.default_rng(0).standard_normal((1000, 3)).astype(np.float32)
    assert occluded(tree, np.zeros((1000, 3), np.float32), directions).all()

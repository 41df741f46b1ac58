"""Meshes of a stage as arrays, and what a layer gives to them: what passes between the library and the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.usd.source import Binding
from aobake.meshes.scene import FloatArray

__all__ = [
    "Colors",
    "IndexArray",
    "MeshPrim",
    "Opened",
    "Primvar",
    "Values",
    "turned",
    "without_holes",
]

IndexArray: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshPrim:
    """A mesh as it is on the stage.

    points : (V, 3) float64     sizes : (F,) corners of each face     corners : (sum of sizes,) points of all
    normals : (N, 3) as authored, or None; by_corner : whether they belong to corners, not to points
    authored : (sum of sizes,) which corner on the stage each is;  solid : (F,) which face each is
    texture, colors, ao : primvars, where there are some that fit
    transforms : (4, 4) each, for column vectors: where it stands; several under a point instancer
    """

    binding: Binding
    name: str
    points: FloatArray
    sizes: IndexArray
    corners: IndexArray
    normals: FloatArray | None
    by_corner: bool
    subdivided: bool
    double_sided: bool
    transforms: tuple[FloatArray, ...]
    authored: IndexArray
    solid: IndexArray
    texture: Values | None
    colors: Values | None
    ao: Values | None


@dataclass(frozen=True, eq=False)
class Values:
    """A primvar of a mesh. values : (N, k) float64, as many as the interpolation asks for"""

    values: FloatArray
    interpolation: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Opened:
    """A stage. prims : its meshes     layers : files it is made of     counts : prims by type

    said : what the library had to say     about : metadata, by name     was_baked : by aobake, as a layer
    """

    prims: tuple[MeshPrim, ...]
    layers: tuple[Path, ...]
    counts: Mapping[str, int]
    said: tuple[str, ...]
    about: Mapping[str, str]
    was_baked: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Colors:
    """What displayColor is at a mesh. values : (N, 3) float64     interpolation : as USD names it"""

    values: FloatArray
    interpolation: str
    sizes: IndexArray
    corners: IndexArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Primvar:
    """Values for a layer to give to a mesh. values : (N, 3) for colours, (N,) else"""

    name: str
    values: NDArray[np.float32]
    interpolation: str


def turned(sizes: IndexArray, corners: IndexArray) -> IndexArray:
    """Each face the other way round, from its own last corner on."""
    ends = np.repeat(np.cumsum(sizes), sizes)
    begins = ends - np.repeat(sizes, sizes)
    return corners[ends - 1 - (np.arange(len(corners)) - begins)]


def without_holes(
    sizes: IndexArray, holes: IndexArray
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(F,) which faces are no holes, and (sum of sizes,) which corners are theirs."""
    solid = np.ones(len(sizes), np.bool_)
    solid[holes[(holes >= 0) & (holes < len(sizes))]] = False
    return solid, np.repeat(solid, sizes)

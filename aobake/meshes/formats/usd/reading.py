"""A USD file as a scene: one mesh for each mesh prim, as it is at the stage's earliest time.

Cages of subdivision surfaces and skinned meshes are read as they are authored: what is baked is what
the points are.
"""

from __future__ import annotations

import importlib.util
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aobake.errors import InputError
from aobake.files import read_bytes
from aobake.meshes.formats.polygons import triangle_corners
from aobake.meshes.formats.usd.source import Binding, UsdSource
from aobake.meshes.scene import (
    Attribute,
    FloatArray,
    Instance,
    IntArray,
    Material,
    Mesh,
    Scene,
)

if TYPE_CHECKING:
    from aobake.meshes.formats.usd.prims import MeshPrim, Opened

__all__ = ["available", "read"]


def available() -> bool:
    """Whether Pixar's library (usd-core) is installed."""
    return importlib.util.find_spec("pxr") is not None


def read(path: Path, *, root: Path | None, scene: str | None) -> Scene:
    """The scene on the stage of a USD file (.usd, .usda, .usdc, .usdz).

    root : a folder whose files may be layers as well; None: the file's own folder alone
    scene : not None is refused, for there is one alone
    Raises InputError for what cannot be read, and where the package usd-core is not installed.
    """
    if scene is not None:
        raise InputError(
            f"{path}: a USD file holds one scene, and scene {scene!r} was asked for. Leave it out."
        )
    if not available():
        raise InputError(
            f"{path}: reading USD needs the package usd-core, not installed here. "
            'Install the extra: pip install "aobake[usd]".'
        )
    read_bytes(path)  # says in one line why it cannot be had
    from aobake.meshes.formats.usd.stage import opened

    stage = opened(path)
    _refuse_outside(path, root, stage.layers)
    bindings, instances = _placed(stage)
    said = tuple(f"{path.name}: {text}" for text in stage.said)
    return Scene(
        meshes=tuple(_mesh(prim) for prim in stage.prims),
        instances=tuple(instances),
        materials=(Material(name="front"), Material(name="both sides", double_sided=True)),
        source=UsdSource(
            path=path,
            files=(path, *_others(path, stage.layers)),
            bindings=tuple(bindings),
            found=_facts(stage, instances),
            was_baked=stage.was_baked,
        ),
        warnings=said,
    )


def _placed(stage: Opened) -> tuple[list[Binding], list[Instance]]:
    bindings: list[Binding] = []
    instances: list[Instance] = []
    users = Counter(prim.binding for prim in stage.prims for _ in prim.transforms)
    first: dict[Binding, int] = {}
    for number, prim in enumerate(stage.prims):
        for transform in prim.transforms:
            shared = first.setdefault(prim.binding, len(instances))
            bindings.append(prim.binding)
            instances.append(
                Instance(
                    mesh=number,
                    transform=transform,
                    name=prim.name,
                    stored_with=shared if users[prim.binding] > 1 else None,
                )
            )
    return bindings, instances


def _mesh(prim: MeshPrim) -> Mesh:
    triangles = triangle_corners(prim.points, prim.corners, prim.sizes)
    return Mesh(
        vertices=prim.points,
        faces=prim.corners.astype(np.int32)[triangles],
        normals=_normals(prim),
        name=prim.name,
        material=int(prim.double_sided),
        attributes=_attributes(prim, triangles),
    )


def _attributes(prim: MeshPrim, triangles: IntArray) -> dict[str, Attribute]:
    """TEXCOORD_0, COLOR_0 and _AO of a mesh, where it has them."""
    found = {}
    if prim.texture is not None:  # its v runs up
        downwards = prim.texture.values * (1.0, -1.0) + (0.0, 1.0)
        found["TEXCOORD_0"] = _attribute(prim, triangles, prim.texture.interpolation, downwards)
    for name, primvar in (("COLOR_0", prim.colors), ("_AO", prim.ao)):
        if primvar is not None:
            found[name] = _attribute(prim, triangles, primvar.interpolation, primvar.values)
    return found


def _attribute(
    prim: MeshPrim, triangles: IntArray, interpolation: str, values: FloatArray
) -> Attribute:
    if interpolation in {"vertex", "varying"}:
        return Attribute(values=values)
    if interpolation == "faceVarying":
        return Attribute(values=values, corners=prim.authored.astype(np.int32)[triangles])
    of_face = np.zeros(len(prim.sizes), np.int64) if interpolation == "constant" else prim.solid
    of_triangle = np.repeat(of_face, np.maximum(prim.sizes - 2, 0))
    return Attribute(
        values=values, corners=np.repeat(of_triangle[:, None], 3, axis=1).astype(np.int32)
    )


def _normals(prim: MeshPrim) -> FloatArray | None:
    """(V, 3), the mean of the normals of each vertex's corners; None where there are none that count.

    Normals of a subdivision cage count for nothing in USD: the surface has its own.
    """
    if prim.normals is None or prim.subdivided:
        return None
    if not prim.by_corner:
        return prim.normals
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(prim.normals, axis=1, keepdims=True)
        unit = np.where(lengths > 0, prim.normals / lengths, 0.0)
    total = np.zeros_like(prim.points)
    np.add.at(total, prim.corners, np.nan_to_num(unit))
    return total


def _refuse_outside(path: Path, root: Path | None, layers: tuple[Path, ...]) -> None:
    folders = [path.resolve().parent, *([root.resolve()] if root is not None else [])]
    for layer in layers:
        if not any(_package(layer.resolve()).is_relative_to(folder) for folder in folders):
            raise InputError(
                f"{path}: it is made of {layer}, which lies outside of its folder. "
                "Allow that with --root FOLDER."
            )


def _package(layer: Path) -> Path:
    """The file that a layer lies in: 'a.usdz[b.usdc]' is a part of a.usdz."""
    text = str(layer)
    return Path(text.split("[", 1)[0]) if text.endswith("]") else layer


def _others(path: Path, layers: tuple[Path, ...]) -> tuple[Path, ...]:
    here = path.resolve()
    files = dict.fromkeys(_package(layer.resolve()) for layer in layers)
    return tuple(file for file in files if file != here)


def _facts(stage: Opened, instances: list[Instance]) -> Mapping[str, object]:
    counts = stage.counts
    return {
        **stage.about,
        "layers": [layer.name for layer in stage.layers],
        "prims": sum(counts.values()) - 1,  # the pseudo-root has no type, and is none
        "meshes": len(stage.prims),
        "instances": len(instances),
        "faces": sum(len(prim.sizes) for prim in stage.prims),
        "subdivision cages": sum(prim.subdivided for prim in stage.prims),
        "point instancers": counts.get("PointInstancer", 0),
        "materials": counts.get("Material", 0),
        "skeletons": counts.get("Skeleton", 0),
        "a bake touches": [prim.binding.path for prim in stage.prims],
        "problems": list(stage.said),
    }

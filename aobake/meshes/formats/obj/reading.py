"""An OBJ file as a scene of one mesh, whose vertices are the file's own, in its order."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from aobake.errors import InputError
from aobake.files import read_bytes
from aobake.meshes.formats.obj.attributes import attributes_of
from aobake.meshes.formats.obj.geometry import Geometry, parse
from aobake.meshes.formats.obj.looks import looks_of
from aobake.meshes.formats.obj.materials import side_files
from aobake.meshes.formats.obj.source import ObjSource
from aobake.meshes.formats.polygons import triangle_corners
from aobake.meshes.scene import FloatArray, Instance, Mesh, Scene

__all__ = ["read"]

FREE_FORM = (b"curv", b"curv2", b"surf")
LINES_AND_POINTS = (b"p", b"l")


def read(path: Path, *, root: Path | None, scene: str | None) -> Scene:
    """The scene in an OBJ file: one mesh of all its polygons, in triangles.

    root : the folder that material libraries and textures may lie in; None: the file's own
    scene : not None is refused, for there is one alone
    Raises InputError, with the line, for what cannot be read. A file without faces gives no triangles.
    """
    if scene is not None:
        raise InputError(
            f"{path}: an OBJ file holds one scene, and scene {scene!r} was asked for. Leave it out."
        )
    text = read_bytes(path)
    geometry = parse(text, str(path))
    triangles = triangle_corners(geometry.positions, geometry.corners, geometry.sizes)
    normals = _vertex_normals(geometry)
    beside = side_files(path, geometry.names.get(b"mtllib", ()), root)
    looks = looks_of(path, root, beside.statements, geometry)
    mesh = Mesh(
        vertices=geometry.positions,
        faces=geometry.corners.astype(np.int32)[triangles],
        normals=normals,
        name=path.stem,
        material=looks.only,
        attributes=attributes_of(text, str(path), geometry, triangles),
    )
    warnings = [*_warnings(geometry), *beside.warnings]
    source = ObjSource(
        path=path,
        files=(path, *beside.files),
        text=text,
        found=_facts(text, geometry, len(triangles), normals is not None, warnings),
        rational=bool(geometry.values[4]) and any(geometry.others[word] for word in FREE_FORM),
        five_numbers=geometry.values[5],
    )
    return Scene(
        meshes=(mesh,),
        instances=(Instance(mesh=0, name=mesh.name),),
        materials=looks.materials,
        images=looks.images,
        source=source,
        warnings=tuple(warnings),
    )


def _vertex_normals(geometry: Geometry) -> FloatArray | None:
    """(V, 3) mean of the unit normals of each vertex's corners; None where a corner has none.

    A normal that several faces share counts once, so that a quad weighs as much as its two triangles.
    """
    given, corners = geometry.corner_normals, geometry.corners
    if not len(given) or given.min() < 0 or given.max() >= len(geometry.normals):
        return None
    pairs = corners * np.int64(len(geometry.normals)) + given
    if not np.array_equal(given, corners):  # one normal each, in the same order, is the usual case
        pairs = np.unique(pairs)
    else:
        pairs = np.flatnonzero(np.bincount(corners, minlength=len(geometry.positions)))
        pairs = pairs * np.int64(len(geometry.normals)) + pairs
    vertex, normal = np.divmod(pairs, len(geometry.normals))
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(geometry.normals, axis=1, keepdims=True)
        unit = np.where(lengths > 0, geometry.normals / lengths, 0.0)
    unit[~np.isfinite(unit).all(axis=1)] = 0.0
    return np.stack(
        [np.bincount(vertex, unit[normal, axis], len(geometry.positions)) for axis in range(3)],
        axis=1,
    )


def _warnings(geometry: Geometry) -> list[str]:
    found = []
    small = int((geometry.sizes < 3).sum())
    if small:
        found.append(f"{small} faces have fewer than three corners and are passed over.")
    surfaces = sum(geometry.others[keyword] for keyword in FREE_FORM)
    if surfaces:
        found.append(
            f"{surfaces} free-form curves and surfaces are passed over; polygons alone are baked."
        )
    if len(geometry.corner_normals) and geometry.corner_normals.max() >= len(geometry.normals):
        found.append("Faces point at normals that do not exist, so all normals are computed anew.")
    return found


def _facts(
    text: bytes, geometry: Geometry, triangles: int, normals: bool, warnings: list[str]
) -> Mapping[str, object]:
    colored = sum(times for values, times in geometry.values.items() if values >= 6)
    return {
        "vertices": len(geometry.positions),
        "faces": len(geometry.sizes),
        "triangles": triangles,
        "normals": "of every corner" if normals else "none that can be used",
        "texture coordinates": geometry.texture_coordinates,
        "vertex colors": f"{colored} of {len(geometry.positions)} vertices",
        "objects": _names(geometry, b"o"),
        "groups": _names(geometry, b"g"),
        "materials": _names(geometry, b"usemtl"),
        "material libraries": _names(geometry, b"mtllib"),
        "lines and points": sum(geometry.others[keyword] for keyword in LINES_AND_POINTS),
        "encoding": _line_ends(text),
        "a bake touches": "the colors of the vertex lines (v x y z r g b)",
        "problems": list(warnings),
    }


def _names(geometry: Geometry, keyword: bytes) -> list[str]:
    names = dict.fromkeys(geometry.names.get(keyword, ()))
    return [name.decode("utf-8", "replace") for name in names]


def _line_ends(text: bytes) -> str:
    if b"\r\n" in text:
        return "text, CRLF line ends"
    return "text, LF line ends" if b"\n" in text or b"\r" not in text else "text, CR line ends"

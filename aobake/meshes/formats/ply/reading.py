"""A PLY file as a scene of one mesh, whose vertices are the file's own, in its order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aobake.errors import InputError
from aobake.files import read_bytes
from aobake.meshes.formats.ply.attributes import Corners, attributes_of
from aobake.meshes.formats.ply.body import Body, open_body
from aobake.meshes.formats.ply.header import Element, Header, Property, parse_header
from aobake.meshes.formats.ply.layout import Layout, layouts, list_values, scalar_values
from aobake.meshes.formats.ply.source import PlySource
from aobake.meshes.formats.polygons import strip_triangles, triangle_corners
from aobake.meshes.formats.tokens import IndexArray
from aobake.meshes.scene import FloatArray, IntArray, Mesh, Scene

__all__ = ["read"]

INDEX_LISTS = ("vertex_indices", "vertex_index")
CURE = "Export the file again."


def read(path: Path, *, root: Path | None, scene: str | None) -> Scene:  # noqa: ARG001 - Reader
    """The scene in a PLY file: one mesh of its faces and triangle strips.

    root : not used, for PLY files refer to no others
    scene : not None is refused, for there is one alone
    Raises InputError for what cannot be read. A point cloud gives a mesh without triangles.
    """
    if scene is not None:
        raise InputError(
            f"{path}: a PLY file holds one scene, and scene {scene!r} was asked for. Leave it out."
        )
    data = read_bytes(path)
    where = str(path)
    header = parse_header(data, where)
    _refuse_doubled(header, where)
    body = open_body(data, header, where)
    rows = {layout.element.name: layout for layout in layouts(body, header, where)}
    vertices = _triple(body, rows.get("vertex"), "xyz")
    if vertices is None:
        raise InputError(
            f"{where}: it has no element vertex with the properties x, y and z. {CURE}"
        )
    faces = _faces(body, rows, vertices, where)
    mesh = Mesh(
        vertices=vertices,
        faces=faces.triangles,
        normals=_triple(body, rows.get("vertex"), ("nx", "ny", "nz")),
        name=path.stem,
        attributes=attributes_of(data, header, where, faces.corners),
    )
    found = _facts(header, faces)
    source = PlySource(path=path, data=data, header=header, found=found)
    return Scene.from_meshes([mesh], source=source, warnings=faces.warnings)


def _refuse_doubled(header: Header, where: str) -> None:
    names = [element.name for element in header.elements]
    for name in ("vertex", "face", "tristrips"):
        if names.count(name) > 1:
            raise InputError(
                f"{where}: element {name!r} is declared {names.count(name)} times. {CURE}"
            )


def _triple(body: Body, vertices: Layout | None, names: tuple[str, ...] | str) -> FloatArray | None:
    """(V, 3) three properties of the vertices; None where one is missing."""
    if vertices is None:
        return None
    found = [vertices.element.scalar(name) for name in names]
    columns = [scalar_values(body, vertices, prop) for prop in found if prop is not None]
    if len(columns) != len(names):
        return None
    triple = np.empty((vertices.element.count, 3))
    for axis, column in enumerate(columns):
        triple[:, axis] = column
    return triple


@dataclass(frozen=True, eq=False)
class _Faces:
    """Triangles of all faces and strips, how many faces there are, and what was passed over.

    corners : which corners of faces the triangles have; None where some are of strips
    """

    triangles: IntArray
    polygons: int
    warnings: tuple[str, ...]
    corners: Corners | None


def _faces(body: Body, rows: Mapping[str, Layout], vertices: FloatArray, where: str) -> _Faces:
    found, warnings = [np.zeros((0, 3), np.int32)], []
    polygons = Corners(np.zeros(0, np.int64), found[0])
    if (layout := rows.get("face")) is not None and layout.element.count:
        corners, sizes = _indices(body, layout, len(vertices), 0, where)
        polygons = Corners(sizes, triangle_corners(vertices, corners, sizes))
        found.append(corners.astype(np.int32)[polygons.triangles])
        if small := int((sizes < 3).sum()):
            warnings.append(f"{small} faces have fewer than three corners and are passed over.")
    if (layout := rows.get("tristrips")) is not None and layout.element.count:
        found.append(strip_triangles(*_indices(body, layout, len(vertices), -1, where)))
    triangles = np.concatenate(found)
    of_faces = len(triangles) == len(polygons.triangles)
    return _Faces(triangles, len(polygons.sizes), tuple(warnings), polygons if of_faces else None)


def _indices(
    body: Body, layout: Layout, vertices: int, least: int, where: str
) -> tuple[IndexArray, IndexArray]:
    """Checked vertex indices, row after row, and how many each row has; from `least`."""
    prop = _index_list(layout.element)
    if prop is None:
        raise InputError(
            f"{where}: element {layout.element.name!r} has no list of whole numbers named vertex_indices or "
            f"vertex_index. {CURE}"
        )
    values, sizes = list_values(body, layout, prop)
    with np.errstate(invalid="ignore"):
        indices = values.astype(np.int64)
    wrong = (indices < least) | (indices >= vertices)
    if values.dtype.kind == "f":
        wrong |= values != np.floor(values)  # text: 1.5, nan
    if wrong.any():
        at = int(np.argmax(wrong))
        row = int(np.searchsorted(np.cumsum(sizes), at, side="right"))
        raise InputError(
            f"{where}: {layout.element.name} {row} (from 0) points at vertex {values[at]:.17g}; there are "
            f"{vertices} vertices (from 0). {CURE}"
        )
    return indices, sizes


def _index_list(element: Element) -> Property | None:
    for prop in element.properties:
        if prop.name in INDEX_LISTS and prop.count_type is not None and prop.type[0] != "f":
            return prop
    return None


def _facts(header: Header, faces: _Faces) -> Mapping[str, object]:
    vertex = header.element("vertex")
    names = [prop.name for prop in vertex.properties] if vertex else []
    return {
        "vertices": vertex.count if vertex else 0,
        "faces": faces.polygons,
        "triangles": len(faces.triangles),
        "normals": "of every vertex" if {"nx", "ny", "nz"} <= set(names) else "none",
        "vertex colors": "red, green, blue" if {"red", "green", "blue"} <= set(names) else "none",
        "elements": {element.name: element.count for element in header.elements},
        "properties": {
            element.name: [prop.name for prop in element.properties] for element in header.elements
        },
        "encoding": header.encoding,
        "comments": list(header.comments),
        "a bake touches": "the vertex properties red, green, blue and ao",
        "problems": list(faces.warnings),
    }

"""A scene of another format than glTF as a GLB: its meshes, their looks and their occlusion."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.container import glb_pieces
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.fresh import fresh_source
from aobake.meshes.formats.gltf.jsontext import JsonObject, serialise
from aobake.meshes.formats.gltf.layout import place_bytes, plan_layout
from aobake.meshes.normals import CREASE_DEGREES, unit_rows
from aobake.meshes.scene import Attribute, FloatArray, IntArray, Mesh, Scene
from aobake.meshes.surface import surface_of
from aobake.viewer.textures import dress_materials

__all__ = ["converted"]

AO = "_AO"


def converted(scene: Scene) -> tuple[bytes, tuple[str, ...]]:
    """The scene as a GLB, and what was left out, one line each.

    Vertices are split where texture coordinates or colours belong to corners, and at creases of meshes
    without normals.
    """
    target = scene.source.path.with_suffix(".glb") if scene.source else Path("scene.glb")
    warnings: list[str] = []
    meshes = tuple(_split(_readable(mesh, warnings)) for mesh in scene.meshes)
    scene = dataclasses.replace(scene, meshes=meshes)
    source = fresh_source(scene, target)
    layout = plan_layout(source.document, target)
    edit = Edit(source.document, layout.buffer, layout.start)
    stored = {b.mesh: i.mesh for b, i in zip(source.bindings, scene.instances, strict=True)}
    for number, mesh in stored.items():
        _add_occlusion(edit, number, meshes[mesh])
    dress_materials(edit, scene, warnings)
    binary, _ = place_bytes(layout, edit)
    pieces = glb_pieces(serialise(edit.json), binary, None, target)
    return b"".join(pieces), tuple(dict.fromkeys(warnings))


def _readable(mesh: Mesh, warnings: list[str]) -> Mesh:
    """The mesh with the attributes that can be read."""
    found: dict[str, Attribute] = {}
    for name in mesh.attributes:
        try:
            if mesh.at_corners(name) is not None:
                found[name] = mesh.attributes[name]
        except InputError as error:
            warnings.append(str(error))
    return dataclasses.replace(mesh, attributes=found)


def _split(mesh: Mesh) -> Mesh:
    """The mesh with every value at its vertices: those with different values at their corners are split."""
    normals, normal_rows = _normals(mesh)
    columns = [mesh.faces, normal_rows]
    columns += [a.corners for a in mesh.attributes.values() if a.corners is not None]
    corners = np.stack([column.reshape(-1) for column in columns], axis=1)
    unique, first, number = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    if len(unique) == 0:
        return dataclasses.replace(mesh, attributes={})
    vertex = unique[:, 0]
    attributes = {
        name: Attribute(values=a.values[_rows(a, vertex, first)])
        for name, a in mesh.attributes.items()
    }
    return dataclasses.replace(
        mesh,
        vertices=mesh.vertices[vertex],
        faces=number.reshape(mesh.faces.shape).astype(np.int32),
        normals=normals[unique[:, 1]],
        attributes=attributes,
    )


def _rows(attribute: Attribute, vertex: IntArray, first: NDArray[np.intp]) -> IntArray:
    """(V',) the row of an attribute for each new vertex; `first` is one of its corners."""
    return vertex if attribute.corners is None else attribute.corners.reshape(-1)[first]


def _normals(mesh: Mesh) -> tuple[FloatArray, IntArray]:
    """Unit normals, and (F, 3) which of them each corner has: a vertex's own, or at a crease its facet's."""
    if mesh.normals is not None:
        return mesh.normals, mesh.faces
    smooth = surface_of(mesh).normals
    with np.errstate(all="ignore"):
        a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
        facets = unit_rows(np.cross(b - a, c - a))
    turned = np.einsum("fck,fk->fc", smooth[mesh.faces], facets)
    limit = math.cos(math.radians(CREASE_DEGREES))
    sharp = (np.abs(turned) < limit) & (facets != 0.0).any(axis=1, keepdims=True)
    own_facet = len(smooth) + np.arange(len(facets), dtype=np.int32)[:, None]
    rows = np.where(sharp, own_facet, mesh.faces)
    return np.concatenate([smooth, facets]), rows.astype(np.int32)


def _add_occlusion(edit: Edit, number: int, mesh: Mesh) -> None:
    """Give a mesh of the document its _AO, which a new document is without."""
    if AO not in mesh.attributes:
        return
    values = np.nan_to_num(mesh.attributes[AO].values[:, :1], nan=1.0).astype(np.float32)
    accessor = edit.add_attribute(values, {"componentType": 5126, "type": "SCALAR"})
    meshes = edit.entries("meshes")
    primitive = dict(_primitive(meshes[number]))
    attributes = primitive["attributes"]
    primitive["attributes"] = {**(attributes if isinstance(attributes, dict) else {}), AO: accessor}
    meshes[number] = {**meshes[number], "primitives": [primitive]}


def _primitive(mesh: JsonObject) -> JsonObject:
    primitives = mesh["primitives"]
    return primitives[0] if isinstance(primitives, list) else {}

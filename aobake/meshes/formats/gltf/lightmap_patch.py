"""A lightmap put into a glTF document: texture coordinates, materials and images, and nothing else changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.columns import ColumnPool
from aobake.meshes.formats.gltf.copies import primitives_of, shares, with_attribute
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.lightmap_sets import lightmap_set
from aobake.meshes.formats.gltf.looks import Look, give_looks
from aobake.meshes.formats.gltf.page_textures import PageTextures
from aobake.meshes.formats.gltf.places import Key, Place, Vertices, touched_places, vertices_of
from aobake.meshes.formats.gltf.regather import Regathering, Split
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.lightmap import Kept, Lightmap, Placing, Unwrapped
from aobake.meshes.scene import IntArray, Mesh, Scene

__all__ = ["looks_of", "patch_lightmap"]

WHOLE = slice(None)


@dataclass(frozen=True)
class Part:
    """What a primitive of one node gets.

    column : of its new texture coordinates in the pool; None where it keeps its own
    split : how its vertices are split; None where they stay
    """

    look: Look
    column: int | None = None
    split: Split | None = None


def patch_lightmap(
    edit: Edit, source: GltfSource, scene: Scene, lightmap: Lightmap, textures: PageTextures
) -> None:
    """Write the lightmap of every instance into the edit.

    Meshes whose nodes lie elsewhere on it are copied; the first keeps the original. Raises OutputError.
    """
    places = touched_places(source)
    pool = ColumnPool()
    parts = _parts(source, scene, lightmap, places, pool)
    accessors = [edit.add_accessors(column, (WHOLE,))[0] for column in pool.columns]
    regathering = Regathering(edit)
    looks: dict[Key, Look] = {}
    for share in shares(edit, source, parts):
        primitives = primitives_of(edit, share.mesh)
        for number, part in share.parts.items():
            name = f"TEXCOORD_{part.look.uv_set}"
            if part.split is not None:
                place = places[share.original, number]
                primitives[number] = regathering.primitive(place, part.split, without=name)
            if part.column is not None:
                primitives[number] = with_attribute(
                    primitives[number], name, accessors[part.column]
                )
            looks[share.mesh, number] = part.look
    give_looks(edit, looks, textures.dressed)


def _by_node(
    source: GltfSource, scene: Scene, lightmap: Lightmap
) -> dict[int, dict[Key, tuple[Placing, Mesh]]]:
    """node -> (mesh, primitive) -> where it is on the images, and the scene's mesh for it."""
    found: dict[int, dict[Key, tuple[Placing, Mesh]]] = {}
    for binding, instance, placing in zip(
        source.bindings, scene.instances, lightmap.placings, strict=True
    ):
        if placing is not None:
            key = binding.mesh, binding.primitive
            node = found.setdefault(binding.node, {})
            node.setdefault(key, (placing, scene.meshes[instance.mesh]))
    return found


def looks_of(
    source: GltfSource, scene: Scene, lightmap: Lightmap, places: Mapping[Key, Place]
) -> dict[Key, list[Look]]:
    """(mesh, primitive) of the document as it was read -> its looks, one for each node. Raises OutputError."""
    found: dict[Key, list[Look]] = {}
    for parts in _by_node(source, scene, lightmap).values():
        for key, (placing, _) in parts.items():
            found.setdefault(key, []).append(_look(places[key], placing))
    return found


def _look(place: Place, placing: Placing) -> Look:
    layout = placing.layout
    if isinstance(layout, Unwrapped):
        return Look(placing.page, lightmap_set(place))
    if f"TEXCOORD_{layout.uv_set}" not in place.primitive.needed("attributes"):
        raise OutputError(f"{place.label} has no TEXCOORD_{layout.uv_set} to keep. Unwrap it.")
    return Look(placing.page, layout.uv_set)


def _parts(
    source: GltfSource,
    scene: Scene,
    lightmap: Lightmap,
    places: Mapping[Key, Place],
    pool: ColumnPool,
) -> dict[int, dict[Key, Part]]:
    """node -> (mesh, primitive) -> what it gets."""
    vertices = vertices_of(places)
    splits: dict[tuple[Key, int, int], tuple[Split | None, IntArray]] = {}
    found: dict[int, dict[Key, Part]] = {}
    for node, placed in _by_node(source, scene, lightmap).items():
        for key, (placing, mesh) in placed.items():
            look = _look(places[key], placing)
            layout = placing.layout
            if isinstance(layout, Kept):
                part = Part(look)
            else:
                known = key, id(layout.source), id(layout.faces)
                if known not in splits:
                    splits[known] = _split(places[key], layout, mesh)
                part = _unwrapped_part(look, layout, *splits[known], vertices[key], pool)
            found.setdefault(node, {})[key] = part
    return found


def _unwrapped_part(
    look: Look,
    layout: Unwrapped,
    split: Split | None,
    taken: IntArray,
    vertices: Vertices,
    pool: ColumnPool,
) -> Part:
    uv = layout.uv[taken].astype(np.float32)
    if split is None:
        return Part(look, pool.place(vertices, uv, layout.faces))
    return Part(look, pool.place(Vertices(split, alone=True), uv, split.faces), split)


def _split(place: Place, layout: Unwrapped, mesh: Mesh) -> tuple[Split | None, IntArray]:
    """How the primitive's vertices are split (None: they stay), and which new vertices that takes.

    New vertices that no face uses are left out: primitives often share far more vertices than they use.
    """
    positions = place.primitive.needed("attributes").integer("POSITION")
    vertices = place.reader.reader.accessor(positions).integer("count")
    faces = _as_stored(place, layout, mesh, vertices)
    everything = np.arange(len(layout.source), dtype=np.int32)
    if len(layout.source) == vertices and np.array_equal(layout.source, everything):
        return None, everything
    used = np.zeros(len(layout.source), np.bool_)
    used[faces] = True
    taken = everything[used]
    place_of = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Split(layout.source[taken], place_of[faces]), taken


def _as_stored(place: Place, layout: Unwrapped, mesh: Mesh, vertices: int) -> IntArray:
    """The faces of the layout in the winding of the file. Raises OutputError where they are others.

    A mirroring skin turns the faces of a scene's mesh, and a fresh document is without those that are
    not finite.
    """
    stored = place.reader.faces(place.primitive, vertices)
    finite = np.logical_and.reduce(np.isfinite(mesh.vertices), axis=1)
    kept = np.logical_and.reduce(finite[mesh.faces], axis=1)
    if len(layout.faces) == len(kept):
        for faces in (layout.faces, layout.faces[:, ::-1], layout.faces[kept]):
            if np.array_equal(layout.source[faces], stored):
                return faces
    raise OutputError(
        f"{place.label}: the layout is one of other faces. Bake the scene as it was read."
    )

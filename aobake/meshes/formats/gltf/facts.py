"""What is in a glTF document, for people; only its JSON is looked at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from aobake.meshes.formats.gltf import uris
from aobake.meshes.formats.gltf.document import Document, side_uris
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.geometry import TRIANGLE_MODES

if TYPE_CHECKING:
    from aobake.meshes.formats.gltf.source import GltfSource

__all__ = ["facts"]

MOST_PROBLEMS = 20


def facts(source: GltfSource) -> Mapping[str, object]:
    """What the document holds, what a bake of the chosen scene would touch, and the problems found.

    Counts are those of the file: a mesh that stands in several places counts once.
    """
    document = source.document
    asset = document.top.needed("asset")
    primitives = [primitive for _, _, primitive in _primitives(document)]
    solid = [primitive for primitive in primitives if _is_solid(primitive)]
    return {
        "version": asset.text("version"),
        "generator": asset.text("generator", ""),
        "copyright": asset.text("copyright", ""),
        "scenes": _names(document, "scenes"),
        "scene": source.scene,
        "nodes": document.size("nodes"),
        "meshes": document.size("meshes"),
        "primitives": len(primitives),
        "triangles": sum(_triangles(document, primitive) for primitive in solid),
        "points and lines": len(primitives) - len(solid),
        "materials": document.size("materials"),
        "textures": document.size("textures"),
        "images": document.size("images"),
        "UV sets": max((_sets(primitive) for primitive in solid), default=0),
        "attributes": sorted({name for p in primitives for name in p.needed("attributes").value}),
        "morph targets": max((len(p.list_of("targets")) for p in primitives), default=0),
        "skins": document.size("skins"),
        "animations": [_clip(document, number) for number in range(document.size("animations"))],
        "cameras": document.size("cameras"),
        "extensions used": _strings(document, "extensionsUsed"),
        "extensions required": _strings(document, "extensionsRequired"),
        "a bake touches": _touched(source),
        "problems": _problems(source),
    }


def _primitives(document: Document) -> Iterator[tuple[int, int, Element]]:
    for mesh, entry in enumerate(document.entries("meshes")):
        for number, primitive in enumerate(entry.children("primitives", "primitive")):
            yield mesh, number, primitive


def _is_solid(primitive: Element) -> bool:
    return primitive.integer("mode", 4) in TRIANGLE_MODES


def _triangles(document: Document, primitive: Element) -> int:
    total = document.size("accessors")
    counted = primitive.maybe_index("indices", total, "accessors")
    if counted is None:
        counted = primitive.needed("attributes").index("POSITION", total, "accessors")
    corners = document.entry("accessors", counted).integer("count")
    return (
        corners // 3 if primitive.integer("mode", 4) == TRIANGLE_MODES[0] else max(corners - 2, 0)
    )


def _sets(primitive: Element) -> int:
    return sum(name.startswith("TEXCOORD_") for name in primitive.needed("attributes").value)


def _names(document: Document, name: str) -> list[str]:
    """The number of each entry, with its name where it has one."""
    return [
        f'{number} "{entry.name}"' if entry.name else str(number)
        for number, entry in enumerate(document.entries(name))
    ]


def _clip(document: Document, number: int) -> str:
    """Its number, its name where it has one, and the seconds that it lasts where the file says so."""
    clip = document.entry("animations", number)
    ends: list[float] = []
    for sampler in clip.children("samplers", "sampler"):
        times = sampler.index("input", document.size("accessors"), "accessors")
        ends += document.entry("accessors", times).numbers("max")[:1]
    named = f'{number} "{clip.name}"' if clip.name else str(number)
    return f"{named} ({np.float32(max(ends))!s} s)" if ends else named


def _strings(document: Document, key: str) -> list[str]:
    return [text for text in document.top.list_of(key) if isinstance(text, str)]


def _touched(source: GltfSource) -> list[str]:
    """One line for each mesh: which of its primitives, and where they stand."""
    parts: dict[int, set[int]] = {}
    nodes: dict[int, set[int]] = {}
    for binding in source.bindings:
        parts.setdefault(binding.mesh, set()).add(binding.primitive)
        nodes.setdefault(binding.mesh, set()).add(binding.node)
    return [
        f"{source.document.label('meshes', mesh)} ({len(numbers)} of "
        f"{len(source.document.entry('meshes', mesh).list_of('primitives'))} primitives, "
        f"{len(nodes[mesh])} {'node' if len(nodes[mesh]) == 1 else 'nodes'})"
        for mesh, numbers in parts.items()
    ]


def _problems(source: GltfSource) -> list[str]:
    document = source.document
    found = [*_side_problems(document), *_unseen(source), *_bare(source)]
    more = len(found) - MOST_PROBLEMS
    return found[:MOST_PROBLEMS] + ([f"and {more} more"] if more > 0 else [])


def _side_problems(document: Document) -> Iterator[str]:
    there = document.side_files()
    for uri in side_uris(document.json):
        if uris.is_data(uri) or uri in there:
            continue
        if uris.names_host(uri):
            yield f"{uri[:60]!r} lies elsewhere and is not fetched"
            continue
        side = uris.find(uri, document.path.parent, document.root)
        outside = side is not None and side.exists
        yield f"{uri[:60]!r} " + (
            "is outside of the folder of the asset" if outside else "is missing"
        )


def _unseen(source: GltfSource) -> Iterator[str]:
    shown = {binding.mesh for binding in source.bindings}
    for mesh in sorted({m for m, _, p in _primitives(source.document) if _is_solid(p)} - shown):
        yield f"{source.document.label('meshes', mesh)} is not part of the scene, and is left as it is"


def _bare(source: GltfSource) -> Iterator[str]:
    shown = {(binding.mesh, binding.primitive) for binding in source.bindings}
    for mesh, number, primitive in _primitives(source.document):
        if (mesh, number) in shown and "NORMAL" not in primitive.needed("attributes"):
            label = source.document.label("meshes", mesh)
            yield f"{label} primitive {number} has no normals: it is shaded flat, and baked so"

"""What of a glTF scene can move; only the JSON is looked at."""

from __future__ import annotations

from collections.abc import Iterable

from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.source import Binding
from aobake.meshes.motion import Motion

__all__ = ["motion_of"]


def motion_of(document: Document, bindings: Iterable[Binding], pose: str | None) -> Motion:
    """How the bound parts of a document can move, and the pose in which they stand."""
    skinned: dict[int, None] = {}
    morphed: dict[int, None] = {}
    parts: dict[int, list[Element]] = {}
    joints = document.size("skins") > 0
    for binding in bindings:
        if binding.gpu:  # as its node's first instance
            continue
        mesh = binding.mesh
        if mesh not in parts:
            parts[mesh] = document.entry("meshes", mesh).children("primitives", "primitive")
        primitive = parts[mesh][binding.primitive]
        has_skin = joints and "skin" in document.entry("nodes", binding.node)
        if has_skin and "JOINTS_0" in primitive.needed("attributes"):
            skinned[mesh] = None
        if primitive.list_of("targets"):
            morphed[mesh] = None
    return Motion(
        skinned=tuple(document.label("meshes", mesh) for mesh in skinned),
        morphed=tuple(document.label("meshes", mesh) for mesh in morphed),
        clips=tuple(document.label("animations", n) for n in range(document.size("animations"))),
        pose=pose,
    )

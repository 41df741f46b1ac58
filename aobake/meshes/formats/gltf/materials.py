"""Materials, as far as occlusion and a preview need them."""

from __future__ import annotations

from typing import cast

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.scene import AlphaMode, Material

__all__ = ["read_materials"]

ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")


def read_materials(document: Document) -> tuple[Material, ...]:
    """Every material of a document, in its order. Raises InputError."""
    return tuple(_material(entry) for entry in document.entries("materials"))


def _material(entry: Element) -> Material:
    pbr = entry.child("pbrMetallicRoughness") or Element({}, entry.where)
    red, green, blue, alpha = pbr.numbers("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
    mode = entry.text("alphaMode", "OPAQUE")
    if mode not in ALPHA_MODES:
        raise InputError(
            f"{entry.where}: alphaMode is {mode[:20]!r}; {', '.join(ALPHA_MODES)} exist."
        )
    return Material(
        name=entry.name,
        base_color=(red, green, blue, alpha),
        metallic=pbr.number("metallicFactor", 1.0),
        roughness=pbr.number("roughnessFactor", 1.0),
        double_sided=entry.flag("doubleSided"),
        alpha_mode=cast(AlphaMode, mode),
        alpha_cutoff=entry.number("alphaCutoff", 0.5),
    )

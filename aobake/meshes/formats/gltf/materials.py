"""Materials, as far as occlusion and a preview need them."""

from __future__ import annotations

from typing import cast

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.textures import read_texture
from aobake.meshes.scene import AlphaMode, Material, Texture

__all__ = ["read_materials"]

ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")
EMISSIVE_STRENGTH = "KHR_materials_emissive_strength"
SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"


def read_materials(document: Document) -> tuple[tuple[Material, ...], tuple[str, ...]]:
    """Every material of a document, in its order, and which textures were passed over, one line each.

    A texture that points at what does not exist is no reason to refuse an asset: occlusion needs none.
    Raises InputError.
    """
    reader = _MaterialReader(document)
    return tuple(reader.material(entry) for entry in document.entries("materials")), tuple(
        reader.warnings
    )


class _MaterialReader:
    """Reads materials, and gathers what is wrong with their textures."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.warnings: list[str] = []

    def material(self, entry: Element) -> Material:
        mode = entry.text("alphaMode", "OPAQUE")
        if mode not in ALPHA_MODES:
            raise InputError(
                f"{entry.where}: alphaMode is {mode[:20]!r}; {', '.join(ALPHA_MODES)} exist."
            )
        color, metallic, roughness = _factors(entry)
        pbr = _metallic_roughness(entry)
        normal, occlusion = _part(entry, "normalTexture"), _part(entry, "occlusionTexture")
        return Material(
            name=entry.name,
            base_color=color,
            metallic=metallic,
            roughness=roughness,
            emissive=_emissive(entry),
            double_sided=entry.flag("doubleSided"),
            alpha_mode=cast(AlphaMode, mode),
            alpha_cutoff=entry.number("alphaCutoff", 0.5),
            base_color_texture=self._base_color_texture(entry),
            metallic_roughness_texture=self._texture(pbr, "metallicRoughnessTexture"),
            emissive_texture=self._texture(entry, "emissiveTexture"),
            normal_texture=self._texture(entry, "normalTexture"),
            normal_scale=normal.number("scale", 1.0),
            occlusion_texture=self._texture(entry, "occlusionTexture"),
            occlusion_strength=occlusion.number("strength", 1.0),
            extras=entry.extras,
        )

    def _base_color_texture(self, entry: Element) -> Texture | None:
        glossy = _specular_glossiness(entry)
        if glossy is not None:
            return self._texture(glossy, "diffuseTexture")
        return self._texture(_metallic_roughness(entry), "baseColorTexture")

    def _texture(self, entry: Element, key: str) -> Texture | None:
        try:
            info = entry.child(key)
            return read_texture(self.document, info) if info else None
        except InputError as error:
            self.warnings.append(f"{error} The texture is passed over.")
            return None


def _factors(entry: Element) -> tuple[tuple[float, float, float, float], float, float]:
    """Base colour, metalness and roughness."""
    glossy = _specular_glossiness(entry)
    if glossy is not None:
        red, green, blue, alpha = glossy.numbers("diffuseFactor", (1.0, 1.0, 1.0, 1.0))
        return (red, green, blue, alpha), 0.0, 1.0 - glossy.number("glossinessFactor", 1.0)
    pbr = _metallic_roughness(entry)
    red, green, blue, alpha = pbr.numbers("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
    return (
        (red, green, blue, alpha),
        pbr.number("metallicFactor", 1.0),
        pbr.number("roughnessFactor", 1.0),
    )


def _metallic_roughness(entry: Element) -> Element:
    return entry.child("pbrMetallicRoughness") or Element({}, entry.where)


def _specular_glossiness(entry: Element) -> Element | None:
    """The archived model, where it is all that a material has: one that has both speaks ours itself."""
    return None if _metallic_roughness(entry).value else entry.extension(SPECULAR_GLOSSINESS)


def _emissive(entry: Element) -> tuple[float, float, float]:
    red, green, blue = entry.numbers("emissiveFactor", (0.0, 0.0, 0.0))
    extension = entry.extension(EMISSIVE_STRENGTH)
    strength = extension.number("emissiveStrength", 1.0) if extension else 1.0
    return red * strength, green * strength, blue * strength


def _part(entry: Element, key: str) -> Element:
    """An object of a material; an empty one where it is missing or none."""
    value = entry.value.get(key)
    return Element(value if isinstance(value, dict) else {}, f"{entry.where}, {key}")

"""Textures as materials look them up, and the images behind them, fetched when they are asked for."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.scene import FloatArray, Image, Texture, Wrap

__all__ = ["read_images", "read_texture"]

TRANSFORM = "KHR_texture_transform"
# Images in other encodings; where a texture has one of the core ones as well, that is taken.
SOURCES = ("EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds")
NEAREST = 9728
WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
REPEAT = 10497
IDENTITY = np.eye(2, 3)


def read_images(document: Document) -> tuple[Image, ...]:
    """Every image of a document, in its order; nothing is fetched or decoded yet."""
    return tuple(
        Image(
            name=f"{document.path}: {document.label('images', number)}",
            data=partial(_image_bytes, document, number),
        )
        for number in range(document.size("images"))
    )


def _image_bytes(document: Document, number: int) -> bytes:
    entry = document.entry("images", number)
    if "bufferView" in entry:
        view = entry.index("bufferView", document.size("bufferViews"), "buffer views")
        return bytes(document.view(document.entry("bufferViews", view)))
    if "uri" in entry:
        return document.fetch(entry.text("uri"), entry.where)
    raise InputError(f"{entry.where} has neither a uri nor a bufferView. Export it again.")


def read_texture(document: Document, info: Element) -> Texture | None:
    """The texture that a textureInfo of a material means; None where it has no image.

    Raises InputError where it points at what does not exist.
    """
    number = info.index("index", document.size("textures"), "textures")
    entry = document.entry("textures", number)
    image = _source(document, entry)
    if image is None:
        return None
    sampler = _sampler(document, entry)
    transform = info.extension(TRANSFORM) or Element({}, info.where)
    return Texture(
        image=image,
        uv_set=transform.integer("texCoord", info.integer("texCoord", 0)),
        transform=_matrix(transform),
        wrap=(_wrap(sampler, "wrapS"), _wrap(sampler, "wrapT")),
        nearest=sampler.integer("magFilter", 0) == NEAREST,
    )


def _source(document: Document, texture: Element) -> int | None:
    for entry in (texture, *(texture.extension(name) for name in SOURCES)):
        if entry is not None and "source" in entry:
            return entry.index("source", document.size("images"), "images")
    return None


def _sampler(document: Document, texture: Element) -> Element:
    number = texture.maybe_index("sampler", document.size("samplers"), "samplers")
    return Element({}, texture.where) if number is None else document.entry("samplers", number)


def _wrap(sampler: Element, key: str) -> Wrap:
    code = sampler.integer(key, REPEAT)
    if code not in WRAPS:
        raise InputError(f"{sampler.where}: {key} is {code}; {', '.join(map(str, WRAPS))} exist.")
    return WRAPS[code]


def _matrix(transform: Element) -> FloatArray | None:
    """(2, 3) translation times rotation times scale; None where it changes nothing.

    The rotation is counter-clockwise as one sees the image, whose v runs down, as the extension's text
    and its test model have it. The GLSL printed in the extension turns the other way.
    """
    x, y = transform.numbers("offset", (0.0, 0.0))
    across, down = transform.numbers("scale", (1.0, 1.0))
    angle = transform.number("rotation", 0.0)
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c * across, s * down, x], [-s * across, c * down, y]])
    matrix.flags.writeable = False
    return None if np.array_equal(matrix, IDENTITY) else matrix

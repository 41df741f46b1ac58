"""Texture coordinates, colours and occlusion of a PLY file, read from its bytes when they are asked for.

The file has no rule for names: those here are what Blender, MeshLab and trimesh write.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.attributes import DeferredAttributes
from aobake.meshes.formats.ply.body import Body, open_body
from aobake.meshes.formats.ply.columns import AO, COLOR, MEAN_DISTANCE
from aobake.meshes.formats.ply.header import Element, Header, Property
from aobake.meshes.formats.ply.layout import Layout, layouts, list_values, scalar_values
from aobake.meshes.formats.tokens import IndexArray
from aobake.meshes.scene import Attribute, FloatArray, IntArray

__all__ = ["Corners", "attributes_of"]

ALPHA = "alpha"
TEXTURE = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
WEDGES = "texcoord"  # of each face: u and v of its first corner, of its second, ...


@dataclass(frozen=True, eq=False)
class Corners:
    """sizes : (P,) corners of each face of the file     triangles : (F, 3) int32, which of all these they have"""

    sizes: IndexArray
    triangles: IntArray


def attributes_of(
    data: bytes, header: Header, where: str, corners: Corners | None
) -> DeferredAttributes:
    """TEXCOORD_0, COLOR_0, _AO and _MEAN_DISTANCE, where the file has them.

    corners : None where some triangles have none, being of strips
    Asking for one raises InputError where it cannot be read. The file is opened for each anew: the numbers
    of a text take far more room than the text.
    """
    vertex, face = header.element("vertex"), header.element("face")
    readers: dict[str, Callable[[], Attribute]] = {}
    wedges = (
        next((p for p in face.properties if p.name == WEDGES and p.count_type), None)
        if face
        else None
    )
    if texture := _first_columns(vertex, TEXTURE):
        readers["TEXCOORD_0"] = partial(_texture, data, header, where, texture)
    elif corners is not None and wedges is not None:
        readers["TEXCOORD_0"] = partial(_wedges, data, header, where, wedges, corners)
    if color := _first_columns(vertex, ((*COLOR, ALPHA), COLOR)):
        readers["COLOR_0"] = partial(_columns, data, header, where, color)
    if occlusion := _first_columns(vertex, ((AO,),)):
        readers["_AO"] = partial(_columns, data, header, where, occlusion)
    if distance := _first_columns(vertex, ((MEAN_DISTANCE,),)):
        readers["_MEAN_DISTANCE"] = partial(_columns, data, header, where, distance)
    return DeferredAttributes(readers)


def _first_columns(
    element: Element | None, choices: tuple[tuple[str, ...], ...]
) -> tuple[Property, ...]:
    """The properties of the first choice that is there as a whole; () where none is."""
    for names in choices if element else ():
        found = tuple(prop for name in names if element and (prop := element.scalar(name)))
        if len(found) == len(names):
            return found
    return ()


def _opened(data: bytes, header: Header, where: str, element: str) -> tuple[Body, Layout]:
    body = open_body(data, header, where)
    rows = {layout.element.name: layout for layout in layouts(body, header, where)}
    return body, rows[element]


def _texture(data: bytes, header: Header, where: str, columns: tuple[Property, ...]) -> Attribute:
    return Attribute(values=_downwards(_columns(data, header, where, columns).values))


def _columns(data: bytes, header: Header, where: str, columns: tuple[Property, ...]) -> Attribute:
    """(V, k), bytes and other whole numbers scaled to [0, 1]."""
    body, rows = _opened(data, header, where, "vertex")
    values = [_scaled(scalar_values(body, rows, prop), prop.type) for prop in columns]
    return Attribute(values=np.stack(values, axis=1))


def _wedges(
    data: bytes, header: Header, where: str, wedges: Property, corners: Corners
) -> Attribute:
    values, sizes = list_values(*_opened(data, header, where, "face"), wedges)
    if (wrong := sizes != 2 * corners.sizes).any():
        face = int(np.argmax(wrong))
        raise InputError(
            f"{where}: face {face} (from 0) has {sizes[face]} numbers in its list {wedges.name!r}; "
            f"{2 * corners.sizes[face]} are needed, u and v of each corner. Export the file again."
        )
    uv = _scaled(values, wedges.type).reshape(-1, 2)
    return Attribute(values=_downwards(uv), corners=corners.triangles)


def _downwards(uv: FloatArray) -> FloatArray:
    """Texture coordinates whose v runs down; in these files it runs up."""
    return uv * (1.0, -1.0) + (0.0, 1.0)


def _scaled(values: NDArray[np.generic], type_: str) -> FloatArray:
    """float64; whole numbers from 0 to the largest of their type become [0, 1]."""
    found = values.astype(np.float64)
    return found if type_[0] == "f" else found / np.iinfo(type_).max

"""What a bake puts into the vertices of a PLY file: which properties are replaced, and which are new."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.ply.body import Body, Numbers
from aobake.meshes.formats.ply.header import Element, Property
from aobake.meshes.formats.ply.layout import Layout, scalar_values
from aobake.settings import StoreSettings

__all__ = ["AO", "COLOR", "Changes", "Held", "NewColumn", "byte_colors", "changes", "held_by"]

COLOR = ("red", "green", "blue")
AO = "ao"


@dataclass(frozen=True, eq=False)
class NewColumn:
    """A property that is appended. type : numpy's name of it, without the byte order"""

    name: str
    type: str
    values: Numbers


@dataclass(frozen=True, eq=False)
class Changes:
    """replaced : (property, its new values), the type kept     removed : properties that go

    new : properties that come after the last one
    """

    replaced: tuple[tuple[Property, Numbers], ...]
    removed: tuple[Property, ...]
    new: tuple[NewColumn, ...]


@dataclass(frozen=True, eq=False)
class Held:
    """What the vertices have already. colors : those to be multiplied     ao : the property of that name"""

    colors: tuple[Property, ...]
    ao: Property | None


def held_by(element: Element, store: StoreSettings, where: str) -> Held:
    """What the vertices hold, as far as a bake with this store is concerned with it.

    Raises OutputError where colours are there in part, or as lists.
    """
    ao = element.scalar(AO)
    if ao is None and any(prop.name == AO for prop in element.properties):
        raise OutputError(
            f"{where}: the vertices have a list named {AO}. Rename it, or write GLB instead."
        )
    colors = _color_properties(element, where) if store.store == "color" else []
    return Held(tuple(colors), ao)


def byte_colors(ao: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(V,) ambient occlusion as a colour of one byte, to the nearest."""
    rounded: NDArray[np.uint8] = np.rint(np.clip(ao.astype(np.float64), 0.0, 1.0) * 255.0).astype(
        np.uint8
    )
    return rounded


def changes(
    body: Body, layout: Layout, ao: NDArray[np.float32], store: StoreSettings, where: str
) -> Changes:
    """What has to be done to the vertex element so that it holds ambient occlusion.

    ao : (V,) float32
    Existing colours are multiplied and keep their type. A property `ao` that is there is overwritten
    where it is a float or a double, and else replaced by a float.
    Raises OutputError where colours are there in part, or as lists.
    """
    held = held_by(layout.element, store, where)
    replaced: list[tuple[Property, Numbers]] = []
    removed: list[Property] = []
    new: list[NewColumn] = []
    if store.store == "color":
        replaced += [
            (prop, _multiplied(scalar_values(body, layout, prop), prop, ao)) for prop in held.colors
        ]
        if not held.colors:
            new += [NewColumn(name, "u1", byte_colors(ao)) for name in COLOR]
    if held.ao is not None and held.ao.type[0] == "f":
        replaced.append((held.ao, ao.astype(held.ao.type)))
    else:
        if held.ao is not None:
            removed.append(held.ao)
        new.append(NewColumn(AO, "f4", ao.astype(np.float32)))
    return Changes(tuple(replaced), tuple(removed), tuple(new))


def _color_properties(element: Element, where: str) -> list[Property]:
    """The properties red, green and blue, or none of them."""
    found = [prop for prop in map(element.scalar, COLOR) if prop is not None]
    named = {prop.name for prop in element.properties if prop.name in COLOR}
    if len(found) in (0, 3) and len(named) == len(found):
        return found
    raise OutputError(
        f"{where}: the vertices have {', '.join(sorted(named))} of red, green and blue, so there is no color to "
        "darken. Keep the values apart with --store attribute."
    )


def _multiplied(values: Numbers, prop: Property, ao: NDArray[np.float32]) -> Numbers:
    product = values.astype(np.float64) * np.clip(ao.astype(np.float64), 0.0, 1.0)
    return (np.rint(product) if prop.type[0] != "f" else product).astype(prop.type)

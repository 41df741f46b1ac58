"""Cameras and lights of the nodes that a scene shows, where these stand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeVar, cast

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.nodes import NodeTree
from aobake.meshes.scene import Camera, FloatArray, Light, LightKind

__all__ = ["read_cameras", "read_lights"]

LIGHTS = "KHR_lights_punctual"
KINDS = ("directional", "point", "spot")
Placed = TypeVar("Placed", Camera, Light)


def read_cameras(
    document: Document, tree: NodeTree, shown: Iterable[int]
) -> tuple[tuple[Camera, ...], tuple[str, ...]]:
    """The cameras of these nodes, and which were passed over as broken, one line each."""
    return _of_nodes(document, tree, shown, _camera)


def read_lights(
    document: Document, tree: NodeTree, shown: Iterable[int]
) -> tuple[tuple[Light, ...], tuple[str, ...]]:
    """The lights of these nodes (KHR_lights_punctual), and which were passed over as broken, one line each."""
    return _of_nodes(document, tree, shown, _light)


def _of_nodes(
    document: Document,
    tree: NodeTree,
    shown: Iterable[int],
    read: Callable[[Document, Element, FloatArray], Placed | None],
) -> tuple[tuple[Placed, ...], tuple[str, ...]]:
    found: list[Placed] = []
    warnings: list[str] = []
    for number in shown:
        try:
            placed = read(document, document.entry("nodes", number), tree.world[number])
        except InputError as error:  # a bake needs none of them
            warnings.append(f"{error} It is passed over.")
        else:
            found += [placed] if placed is not None else []
    return tuple(found), tuple(warnings)


def _camera(document: Document, node: Element, world: FloatArray) -> Camera | None:
    number = node.maybe_index("camera", document.size("cameras"), "cameras")
    if number is None:
        return None
    entry = document.entry("cameras", number)
    name = node.name or entry.name
    if entry.text("type") == "orthographic":
        height = 2.0 * _positive(entry.needed("orthographic"), "ymag")
        return Camera(name=name, transform=world, yfov_rad=None, height=height)
    yfov = _positive(entry.needed("perspective"), "yfov")
    if yfov >= math.pi:
        raise InputError(f"{entry.where}: yfov is {yfov:g}; less than pi is needed.")
    return Camera(name=name, transform=world, yfov_rad=yfov)


def _light(document: Document, node: Element, world: FloatArray) -> Light | None:
    extension = node.extension(LIGHTS)
    if extension is None:
        return None
    entry = _light_entry(document, extension)
    kind = entry.text("type")
    if kind not in KINDS:
        raise InputError(f"{entry.where}: type is {kind[:20]!r}; {', '.join(KINDS)} exist.")
    red, green, blue = entry.numbers("color", (1.0, 1.0, 1.0))
    return Light(
        kind=cast(LightKind, kind),
        transform=world,
        name=node.name or entry.name,
        color=(red, green, blue),
        intensity=entry.number("intensity", 1.0),
        range=_positive(entry, "range") if "range" in entry else None,
        cone_rad=_cone(entry),
    )


def _light_entry(document: Document, named: Element) -> Element:
    lights = document.top.extension(LIGHTS)
    entries = lights.list_of("lights") if lights else []
    number = named.index("light", len(entries), "lights")
    value = entries[number]
    if not isinstance(value, dict):
        raise InputError(f"{document.path}: light {number} is no object. Export it again.")
    return Element(value, f"{document.path}: light {number}")


def _cone(entry: Element) -> tuple[float, float]:
    spot = entry.child("spot") or Element({}, entry.where)
    inner = spot.number("innerConeAngle", 0.0)
    outer = spot.number("outerConeAngle", math.pi / 4)
    if not 0.0 <= inner <= outer <= math.pi / 2:
        raise InputError(
            f"{spot.where}: its cone reaches from {inner:g} to {outer:g}; 0 <= inner <= outer <= pi/2 is needed."
        )
    return inner, outer


def _positive(entry: Element, key: str) -> float:
    found = entry.number(key, 0.0)
    if found <= 0.0:
        raise InputError(f"{entry.where}: {key} is {found:g}; more than 0 is needed.")
    return found

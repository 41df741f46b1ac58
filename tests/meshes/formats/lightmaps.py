"""Lightmaps made by hand, and what a file has at the corners of its triangles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats import write_texture_ao
from aobake.meshes.formats.gltf.accessors import SHAPES, AccessorReader, decoded
from aobake.meshes.formats.gltf.document import open_document
from aobake.meshes.formats.gltf.geometry import PrimitiveReader
from aobake.meshes.lightmap import Kept, Lightmap, Placing, Unwrapped
from aobake.meshes.scene import Mesh, Scene
from aobake.settings import ImageSettings

Page = NDArray[np.float32]


def page(seed: int = 0, height: int = 8, width: int = 8) -> Page:
    """An image whose values are steps of 8 bits, so that they come back."""
    values = np.random.default_rng(seed).integers(0, 256, (height, width))
    return (values / 255).astype(np.float32)


def steps(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Values in steps of 8 bits."""
    found: NDArray[np.floating] = np.rint(values * 255)
    return found


def exploded(mesh: Mesh, seed: int = 0, *, like: Unwrapped | None = None) -> Unwrapped:
    """Every triangle alone, its corners anywhere; like: with the same vertices as another one."""
    if like is None:
        source = mesh.faces.reshape(-1)
        faces = np.arange(len(source), dtype=np.int32).reshape(-1, 3)
    else:
        source, faces = like.source, like.faces
    uv = np.random.default_rng(seed).integers(0, 1024, (len(source), 2)) / 1024
    return Unwrapped(source=source, faces=faces, uv=uv)


def smooth(mesh: Mesh) -> Unwrapped:
    """Every vertex once: nothing is split."""
    count = len(mesh.vertices)
    uv = np.random.default_rng(3).integers(0, 1024, (count, 2)) / 1024
    return Unwrapped(source=np.arange(count, dtype=np.int32), faces=mesh.faces, uv=uv)


def lightmap(*layouts: Kept | Unwrapped | None, pages: tuple[Page, ...] | None = None) -> Lightmap:
    """One layout per instance; instance i lies on image i, or on the last one."""
    images = (page(),) if pages is None else pages
    last = max(len(images) - 1, 0)
    return Lightmap(
        pages=images,
        placings=tuple(
            None if layout is None else Placing(page=min(number, last), layout=layout)
            for number, layout in enumerate(layouts)
        ),
    )


def explode_all(scene: Scene, pages: tuple[Page, ...] | None = None) -> Lightmap:
    """Every instance exploded; those of one mesh with the same vertices."""
    first: dict[int, Unwrapped] = {}
    layouts = []
    for seed, (instance, mesh) in enumerate(scene.placed()):
        layout = exploded(mesh, seed, like=first.get(instance.mesh))
        first.setdefault(instance.mesh, layout)
        layouts.append(layout)
    return lightmap(*layouts, pages=pages)


def write(
    scene: Scene, found: Lightmap, target: Path, settings: ImageSettings | None = None
) -> tuple[Path, ...]:
    """Write a lightmap."""
    return write_texture_ao(scene, found, target, settings or ImageSettings())


def at_corners(path: Path, mesh: int = 0, primitive: int = 0) -> dict[str, NDArray[Any]]:
    """Every attribute of a glTF primitive and of its morph targets at the corners, (F, 3, k) as decoded."""
    document = open_document(path, None)
    reader = PrimitiveReader(AccessorReader(document))
    part = document.entry("meshes", mesh).children("primitives", "primitive")[primitive]
    attributes = part.needed("attributes")
    count = reader.reader.accessor(attributes.integer("POSITION")).integer("count")
    faces = reader.faces(part, count)
    found = {}
    for name in attributes.value:
        accessor = reader.reader.accessor(attributes.integer(name))
        values = reader.stored(part, name, tuple(SHAPES))
        assert len(values) == count
        found[name] = decoded(values, accessor.flag("normalized"))[faces]
    for number, target in enumerate(part.children("targets", "target")):
        for name in target.value:
            values = reader.reader.floats(target.integer(name), ("VEC3",))
            found[f"target {number} {name}"] = values[faces]
    return found

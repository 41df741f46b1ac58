"""The images of a lightmap, without an asset around them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aobake.files import check_writable, write_files
from aobake.images import KINDS, encode
from aobake.meshes.lightmap import Lightmap, Unwrapped
from aobake.meshes.scene import Scene
from aobake.settings import ImageSettings

__all__ = ["check_texture", "write_texture"]


def check_texture(
    scene: Scene,  # noqa: ARG001 - every writer is asked in the same way
    image: ImageSettings,
    target: Path,
    lightmap: Lightmap | None = None,
) -> tuple[str, ...]:
    """Raise OutputError where the image cannot hold the encoding, or cannot be written.

    Returns a line where the images fit texture coordinates that are kept nowhere.
    """
    encode(np.ones((1, 1), np.float32), KINDS[target.suffix.lower()], image.encoding)
    found = []
    if image.pack == "orm":
        found.append(f"{target}: an image alone is not packed; only glTF is")
    for path in _paths(target, lightmap):
        check_writable(path)
    if lightmap is not None and any(
        placing is not None and isinstance(placing.layout, Unwrapped)
        for placing in lightmap.placings
    ):
        found.append(
            f"{target}: the image fits new texture coordinates, which only an asset can hold; "
            "write that as well (-o NAME.glb)"
        )
    return tuple(found)


def write_texture(
    scene: Scene, lightmap: Lightmap, target: Path, image: ImageSettings
) -> tuple[Path, ...]:
    """Write every image: NAME.png, NAME_2.png, ..., and bent normals as NAME_bent_normal.png, ...

    Returns the files written. Raises OutputError, with none written.
    """
    check_texture(scene, image, target)
    kind = KINDS[target.suffix.lower()]
    paths = _paths(target, lightmap)
    contents = [encode(page, kind, image.encoding) for page in lightmap.pages]
    if lightmap.bent is not None:
        pages = range(len(lightmap.bent.pages))
        contents += [encode(lightmap.bent.image(page), kind, image.encoding) for page in pages]
    write_files(dict(reversed(list(zip(paths, contents, strict=True)))))
    return paths


def _paths(target: Path, lightmap: Lightmap | None) -> tuple[Path, ...]:
    if lightmap is None:
        return (target,)
    paths = _numbered(target, len(lightmap.pages))
    if lightmap.bent is None:
        return paths
    beside = target.with_name(f"{target.stem}_bent_normal{target.suffix}")
    return (*paths, *_numbered(beside, len(lightmap.bent.pages)))


def _numbered(first: Path, count: int) -> tuple[Path, ...]:
    others = [first.with_name(f"{first.stem}_{n}{first.suffix}") for n in range(2, count + 1)]
    return (first, *others)[:count]

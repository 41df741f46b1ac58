"""Ambient occlusion into an OBJ file: colours on the vertex lines, and every other byte as it was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.files import make_folder, write_files
from aobake.meshes.formats.beside import copies_beside
from aobake.meshes.formats.merged import merged
from aobake.meshes.formats.obj.fresh import document
from aobake.meshes.formats.obj.geometry import vertex_values
from aobake.meshes.formats.obj.source import ObjSource
from aobake.meshes.formats.obj.statements import Block, blocks
from aobake.meshes.formats.tokens import IndexArray, spliced
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["check", "patched", "write"]

NEITHER = (
    "which is neither x y z w nor x y z r g b, so there is no place for a color. "
    "Write PLY or GLB instead (-o NAME.ply)."
)


def check(scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
    """Raise OutputError for what OBJ has no place for, and for side files that are in the way.

    Vertex colours are the one place that OBJ has: a line says so where another store was asked for.
    """
    if isinstance(scene.source, ObjSource):
        _refuse_without_place(scene.source)
        copies_beside(scene.source.path, scene.source.files[1:], target)
    if store.store == "color":
        return ()
    return (
        f'{target}: OBJ has vertex colors alone, so these are darkened, and store "{store.store}" was left aside; '
        "GLB can hold it",
    )


def _refuse_without_place(source: ObjSource) -> None:
    if source.rational:
        raise OutputError(
            f"{source.path}: its free-form surfaces use weights (v x y z w), which a vertex color "
            "would displace. Write GLB or PLY instead (-o NAME.ply)."
        )
    if source.five_numbers:
        raise OutputError(
            f"{source.path}: {source.five_numbers} vertex lines have five numbers, {NEITHER}"
        )


def write(
    scene: Scene, ao: Sequence[NDArray[np.float32]], target: Path, store: StoreSettings
) -> tuple[Path, ...]:
    """Write the scene's OBJ file with vertex colours, or a new one where it was read from no OBJ file.

    ao : one (V_i,) float32 array per instance
    Returns the files written, the target first, then material libraries and textures copied beside it.
    Raises OutputError; nothing is half-written.
    """
    check(scene, store, target)
    if not isinstance(scene.source, ObjSource):
        write_files({target: document(merged(scene, ao))})
        return (target,)
    if len(ao) != 1:
        raise OutputError(
            f"{target}: an OBJ file is one mesh, and there are values for {len(ao)}. Write GLB."
        )
    text = patched(scene.source.text, ao[0], str(target))
    copies = copies_beside(scene.source.path, scene.source.files[1:], target)
    for copy in copies:
        make_folder(copy.parent, needed_by=target.name)
    write_files({**copies, target: text})
    return (target, *copies)


def patched(text: bytes, ao: NDArray[np.float32], where: str) -> bytes:
    """The text of an OBJ file with its vertex colours multiplied by ambient occlusion.

    ao : (V,) float32, one for each `v` line in order
    Raises OutputError where the numbers of vertices differ, or a line has no place for a colour.
    """
    starts: list[int] = []
    ends: list[int] = []
    colors: list[bytes] = []
    done = 0
    for block in blocks(text, where):
        chosen = np.flatnonzero(block.keyword(b"v"))
        begin, end = _spans(block, chosen, where)
        starts += begin.tolist()
        ends += end.tolist()
        colors += _colors(block, chosen, text, ao[done : done + len(chosen)], where)
        done += len(chosen)
    if done != len(ao):
        raise OutputError(
            f"{where}: {len(ao)} values for the {done} vertices of the OBJ file; bake it again."
        )
    return spliced(text, starts, ends, colors)


def _spans(block: Block, vertices: IndexArray, where: str) -> tuple[IndexArray, IndexArray]:
    """Where a colour goes in each vertex line: after z, or in place of the colour that is there.

    A fourth number alone is the weight of rational curves, 1 for polygons; readers would take it for red.
    """
    first, words = block.first[vertices], block.words[vertices]
    if (words == 6).any():
        raise OutputError(f"{where}: a vertex line has five numbers, {NEITHER}")
    colored = words >= 7
    starts = np.where(colored, block.starts[first + np.where(colored, 4, 0)], block.ends[first + 3])
    ends = block.ends[first + np.where(colored, 6, np.where(words == 5, 4, 3))]
    return starts + block.offset, ends + block.offset


def _colors(
    block: Block, vertices: IndexArray, text: bytes, ao: NDArray[np.float32], where: str
) -> list[bytes]:
    values, counts = vertex_values(block, vertices, text, where)
    if not (counts >= 6).any():
        return [b" %.6g %.6g %.6g" % (value, value, value) for value in ao.tolist()]
    begin = np.cumsum(counts) - counts
    colored = counts >= 6
    red = begin[colored]
    rgb = np.ones((len(counts), 3))
    rgb[colored] = values[red[:, None] + np.arange(3, 6)]
    if rgb[colored].max() > 1.0:
        rgb[~colored] = 255.0  # some tools count colours in bytes
    rgb = rgb[: len(ao)] * ao.astype(np.float64)[:, None]
    return [
        (b"%.6g %.6g %.6g" if has else b" %.6g %.6g %.6g") % tuple(color)
        for has, color in zip(colored.tolist(), rgb.tolist(), strict=False)
    ]

"""Side files: what an asset refers to goes with it when it is written into another folder."""

from __future__ import annotations

from pathlib import Path

from aobake.errors import OutputError
from aobake.files import read_bytes, same_file
from aobake.meshes.formats.gltf import uris
from aobake.meshes.formats.gltf.container import Bytes
from aobake.meshes.formats.gltf.document import Document, side_uris
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.layout import known_uris

__all__ = ["side_copies"]


def side_copies(document: Document, json: JsonObject, target: Path) -> dict[Path, list[Bytes]]:
    """Files to be written beside the target, with their content: none within the asset's own folder.

    json : the document as it will be written
    A file that is there already with the same content is left alone; with another content it is
    replaced only where it belongs to the asset that the target replaces. Missing files and those
    outside of the folders that may be read are passed over. Raises OutputError.
    """
    if same_file(document.path.parent, target.parent):
        return {}
    earlier: frozenset[str] | None = None
    copies: dict[Path, list[Bytes]] = {}
    wanted = set(side_uris(json))
    for uri, side in document.side_files().items():
        if uri not in wanted:
            continue
        place = _place(uri, side, target)
        if place is None or place in copies:
            continue
        content = read_bytes(side.path, needed_by=str(document.path))
        if place.is_file():
            if place.read_bytes() == content:
                continue
            earlier = known_uris(target) if earlier is None else earlier
            if uri not in earlier:
                raise OutputError(
                    f"{place}: another file of this name is there, and {document.path.name} needs its own. "
                    f"Write {target.name} into another folder."
                )
        copies[place] = [content]
    return copies


def _place(uri: str, side: uris.SideFile, target: Path) -> Path | None:
    """Where a side file goes; None where the path from the target leads to it already."""
    place = target.parent / side.relative
    if side.below:
        if not place.resolve().is_relative_to(target.parent.resolve()):
            raise OutputError(
                f"{place}: a link leads out of the folder of the output. Write it somewhere else."
            )
        if same_file(place, target):
            raise OutputError(
                f"{target}: the asset has a side file of this name. Give another name."
            )
        return None if same_file(place, side.path) else place
    if same_file(place, side.path) or (
        place.is_file() and place.read_bytes() == side.path.read_bytes()
    ):
        return None
    raise OutputError(
        f"{target}: the asset refers to {uri[:60]!r}, outside of its folder, and from there the path leads "
        "nowhere. Write it beside the source, or into a folder at the same place of the tree."
    )

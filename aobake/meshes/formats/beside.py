"""Side files (material libraries, textures) taken along when an asset is written into another folder."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from aobake.errors import InputError, OutputError
from aobake.files import read_bytes, same_file
from aobake.meshes.formats.references import references

__all__ = ["copies_beside"]


def copies_beside(asset: Path, files: Iterable[Path], target: Path) -> dict[Path, bytes]:
    """The copies that a target in another folder needs: where -> content, for write_files.

    asset : the file that was read     files : what belongs to it     target : what is written for it
    Each keeps its place relative to the asset; one that lies above the asset's folder would leave the
    target's, and is not copied. One that is there already is replaced where the asset that stands at the
    target refers to it: it is the copy of an earlier bake. Empty where the folder stays the same.
    Raises OutputError where another file of that name, with other content, is there already.
    """
    copies: dict[Path, bytes] = {}
    earlier: frozenset[str] | None = None
    folder = asset.parent.absolute()
    for file in files:
        relative = _below(file.absolute(), folder)
        if relative is None:
            continue
        copy = target.parent / relative
        if same_file(file, copy):
            continue
        content = _content(file, asset)
        if copy.exists():
            if _content(copy, target) == content:
                continue
            earlier = frozenset(references(target)) if earlier is None else earlier
            if relative.as_posix() not in earlier:
                raise OutputError(
                    f"{copy}: another file of this name is there, and {target.name} needs the one of "
                    f"{asset}. Move it, or write into another folder."
                )
        copies[copy] = content
    return copies


def _below(file: Path, folder: Path) -> Path | None:
    """The path from the folder down to the file; None where it leads up or away."""
    if not file.is_relative_to(folder):
        return None
    relative = file.relative_to(folder)
    return None if ".." in relative.parts else relative


def _content(file: Path, asset: Path) -> bytes:
    try:
        return read_bytes(file, asset.name)
    except InputError as error:
        raise OutputError(str(error)) from error

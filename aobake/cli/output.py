"""Output files: looked at before the work, not after it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aobake import OutputError, SettingsError
from aobake.errors import nearest
from aobake.files import check_writable, same_file

__all__ = ["check_asset_target", "check_target", "make_folder"]


def check_target(path: Path, *, force: bool, inputs: Sequence[Path] = ()) -> None:
    """Refuse a file that exists, is an input, or cannot be written.

    Raises SettingsError where force would allow it, OutputError where nothing would.
    """
    if not force and any(same_file(path, read) for read in inputs):
        raise SettingsError(
            f"{path}: this is the input itself. Give another name, or --force to replace it."
        )
    if not force and path.is_file():
        raise SettingsError(f"{path}: it exists. Give another name, or --force to replace it.")
    check_writable(path)


def check_asset_target(path: Path, *, force: bool, inputs: Sequence[Path] = ()) -> None:
    """The same for an asset, whose format must be able to hold ambient occlusion."""
    from aobake.meshes.formats import WRITABLE

    suffix = path.suffix.lower()
    if suffix not in WRITABLE:
        raise SettingsError(
            f"{path}: {suffix or 'a name without an ending'} cannot hold ambient occlusion."
            f"{nearest(suffix, WRITABLE)}"
        )
    check_target(path, force=force, inputs=inputs)


def make_folder(path: Path) -> bool:
    """Make a folder unless it is there; whether it was made. Raises OutputError."""
    if path.is_dir():
        return False
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise OutputError(
            f"{path}: this folder cannot be made ({error.strerror or error})."
        ) from error
    return True

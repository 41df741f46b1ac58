"""Output files: looked at before the work, not after it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aobake import OutputError, SettingsError
from aobake.errors import nearest
from aobake.files import check_writable, same_file

__all__ = ["check_asset_target", "check_target"]


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


def check_asset_target(
    path: Path, formats: Sequence[str], what: str, *, force: bool, inputs: Sequence[Path] = ()
) -> None:
    """The same for an asset whose format must be one of several.

    formats : the endings of those that can hold what is written; what : a name for it
    """
    suffix = path.suffix.lower()
    if suffix not in formats:
        of = f" of {inputs[0].name}" if inputs else ""
        message = (
            f"{path}: {suffix or 'a name without an ending'} cannot hold {what}{of}."
            f"{nearest(suffix, formats)}"
        )
        own = any(read.suffix.lower() == suffix for read in inputs)  # the asset is at odds with it
        raise OutputError(message) if own else SettingsError(message)
    check_target(path, force=force, inputs=inputs)

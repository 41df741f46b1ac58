"""The files beside an OBJ file: its material libraries, and the textures that these name."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from aobake.errors import InputError
from aobake.files import read_bytes

__all__ = ["side_files"]

MOST_LIBRARY_BYTES = 1 << 26  # a material library is a few kilobytes of text
TEXTURES = ("map_", "bump", "disp", "decal", "refl", "norm")
# How many words follow an option of a texture statement; -o, -s and -t take one to three numbers.
OPTION_WORDS = {b"-mm": 2, b"-o": 3, b"-s": 3, b"-t": 3}


def side_files(
    path: Path, libraries: Iterable[bytes], root: Path | None
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The files that exist beside an OBJ file and belong to it, and what was passed over, one line each.

    libraries : the texts of its mtllib statements
    root : the folder that they may lie in, with its subfolders; None: the file's own folder
    A file that is missing is passed over in silence, as every viewer does; one outside is warned of.
    """
    found: dict[Path, None] = {}
    warnings: dict[str, None] = {}
    for text in libraries:
        for name in _library_names(path.parent, text):
            library = _within(path, name, root, warnings)
            if library is None or library in found:
                continue
            found[library] = None
            for texture in _texture_names(path, library, warnings):
                image = _within(path, texture, root, warnings)
                if image is not None:
                    found[image] = None
    return tuple(found), tuple(warnings)


def _library_names(folder: Path, text: bytes) -> list[str]:
    """One name with spaces, where there is such a file, else several names."""
    whole = _decoded(text)
    try:
        if (folder / whole).is_file():
            return [whole]
    except (OSError, ValueError):
        pass
    return whole.split()


def _texture_names(path: Path, library: Path, warnings: dict[str, None]) -> list[str]:
    try:
        if library.stat().st_size > MOST_LIBRARY_BYTES:
            warnings[
                f"{library.name}: too large for a material library; its textures are not copied."
            ] = None
            return []
        lines = read_bytes(library, path.name).splitlines()
    except (InputError, OSError):
        warnings[
            f"{library.name}: the material library cannot be read; its textures are not copied."
        ] = None
        return []
    names = []
    for line in lines:
        keyword, _, rest = line.strip().partition(b" ")
        if keyword.decode("ascii", "replace").lower().startswith(TEXTURES) and rest.strip():
            names.append(_without_options(rest.strip()))
    return names


def _without_options(rest: bytes) -> str:
    """The file name of a texture statement, spaces kept: what follows the options."""
    while rest.startswith(b"-"):
        option, _, rest = rest.partition(b" ")
        for _ in range(OPTION_WORDS.get(option, 1)):
            word, _, after = rest.lstrip().partition(b" ")
            if OPTION_WORDS.get(option) == 3 and not _is_number(word):
                break
            rest = after
        rest = rest.lstrip()
    return _decoded(rest)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _decoded(name: bytes) -> str:
    try:
        return name.strip().decode("utf-8")
    except UnicodeDecodeError:
        return name.strip().decode("latin-1")


def _within(path: Path, name: str, root: Path | None, warnings: dict[str, None]) -> Path | None:
    """The file of that name, where it exists and lies in the folder allowed."""
    try:
        limit = (root or path.parent).resolve()
        for spelling in dict.fromkeys((name, name.replace("\\", "/"))):
            file = path.parent / spelling
            if not file.is_file():
                continue
            if file.resolve().is_relative_to(limit):
                return file
            warnings[
                f"{name}: it lies outside of the folder {limit}, and is left where it is "
                "(--root FOLDER widens it)."
            ] = None
            return None
    except (OSError, ValueError, RuntimeError):
        return None
    return None

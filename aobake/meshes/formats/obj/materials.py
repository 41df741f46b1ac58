"""The files beside an OBJ file: its material libraries, and the textures that these name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from aobake.errors import InputError
from aobake.files import read_bytes

__all__ = ["Beside", "Statement", "library_names", "side_files", "texture_bytes", "texture_names"]

MOST_LIBRARY_BYTES = 1 << 26  # a material library is a few kilobytes of text
TEXTURES = ("map_", "bump", "disp", "decal", "refl", "norm")
# How many words follow an option of a texture statement; -o, -s and -t take one to three numbers.
OPTION_WORDS = {b"-mm": 2, b"-o": 3, b"-s": 3, b"-t": 3}


@dataclass(frozen=True)
class Statement:
    """A line of a material library: its keyword in lower case, options as (name, words), the rest as text."""

    keyword: str
    options: tuple[tuple[bytes, tuple[bytes, ...]], ...]
    rest: str


@dataclass(frozen=True)
class Beside:
    """What belongs to an OBJ file and lies beside it.

    files : those that exist;  statements : of all material libraries, in order
    warnings : what was passed over, one line each
    """

    files: tuple[Path, ...]
    statements: tuple[Statement, ...]
    warnings: tuple[str, ...]


def side_files(path: Path, libraries: Iterable[bytes], root: Path | None) -> Beside:
    """The material libraries of an OBJ file, and the textures that they name.

    libraries : the texts of its mtllib statements
    root : the folder that they may lie in, with its subfolders; None: the file's own folder
    A file that is missing is passed over in silence, as every viewer does; one outside is warned of.
    """
    found: dict[Path, None] = {}
    statements: list[Statement] = []
    warnings: dict[str, None] = {}
    for text in libraries:
        for name in _library_names(path.parent, text):
            library = _within(path, name, root, warnings)
            if library is None or library in found:
                continue
            found[library] = None
            read = _statements(path, library, warnings)
            statements += read
            for statement in read:
                if _names_texture(statement):
                    image = _within(path, statement.rest, root, warnings)
                    if image is not None:
                        found[image] = None
    return Beside(tuple(found), tuple(statements), tuple(warnings))


def texture_bytes(path: Path, name: str, root: Path | None) -> bytes:
    """The bytes of a texture that a material library names. Raises InputError."""
    warnings: dict[str, None] = {}
    image = _within(path, name, root, warnings)
    if image is None:
        finding = next(iter(warnings), f"{name}: there is no such file.")
        raise InputError(f"{path}: texture {finding} Put it beside the asset.")
    return read_bytes(image, str(path))


def library_names(statement: bytes) -> tuple[str, ...]:
    """The names that an mtllib statement may mean: its whole text, and each word of it."""
    whole = _decoded(statement)
    return tuple(dict.fromkeys((whole, *whole.split())))


def texture_names(library: bytes) -> tuple[str, ...]:
    """The textures that the text of a material library names."""
    statements = (_statement(line) for line in library.splitlines() if line.strip())
    return tuple(dict.fromkeys(s.rest for s in statements if _names_texture(s)))


def _names_texture(statement: Statement) -> bool:
    return statement.keyword.startswith(TEXTURES) and bool(statement.rest)


def _library_names(folder: Path, text: bytes) -> list[str]:
    """One name with spaces, where there is such a file, else several names."""
    whole = _decoded(text)
    try:
        if (folder / whole).is_file():
            return [whole]
    except (OSError, ValueError):
        pass
    return whole.split()


def _statements(path: Path, library: Path, warnings: dict[str, None]) -> list[Statement]:
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
    return [_statement(line) for line in lines if line.strip()]


def _statement(line: bytes) -> Statement:
    keyword, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
    name = keyword.decode("ascii", "replace").lower()
    rest = rest.strip()
    if not name.startswith(TEXTURES):
        return Statement(name, (), _decoded(rest))
    options = []
    while rest.startswith(b"-"):
        option, _, rest = rest.partition(b" ")
        words, rest = _option_words(option, rest)
        options.append((option, words))
        rest = rest.lstrip()
    return Statement(name, tuple(options), _decoded(rest))


def _option_words(option: bytes, rest: bytes) -> tuple[tuple[bytes, ...], bytes]:
    """The words that belong to an option of a texture statement, and what follows them, spaces kept."""
    words: list[bytes] = []
    for _ in range(OPTION_WORDS.get(option, 1)):
        word, _, after = rest.lstrip().partition(b" ")
        if OPTION_WORDS.get(option) == 3 and not _is_number(word):
            break
        words.append(word)
        rest = after
    return tuple(words), rest


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

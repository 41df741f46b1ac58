"""Material libraries with an occlusion image: every other line as it was."""

from __future__ import annotations

from collections.abc import Collection, Iterable

__all__ = ["definition", "with_occlusion"]

KEYWORDS = (b"map_ka", b"map_ao", b"map_bent_normal")


def with_occlusion(
    library: bytes, materials: Collection[bytes], image: bytes, bent: bytes | None
) -> bytes:
    """The text of a library in which these materials look their occlusion up in the image.

    materials : their names;  image : its file name;  bent : that of the bent normals, or None
    map_Ka, map_ao and map_bent_normal are replaced; a material that is not there is added, white.
    """
    line_end = b"\r\n" if b"\r\n" in library else b"\n"
    found: list[bytes] = []
    missing = dict.fromkeys(materials)
    for block in _definitions(library):
        name = _name(block[0]) if block else None
        if name is None or name not in materials:
            found += block
            continue
        missing.pop(name, None)
        kept = [line for line in block if _keyword(line) not in KEYWORDS]
        while kept[-1:] and not kept[-1].strip():
            kept.pop()
        blank = [line_end] if len(block) > 1 and not block[-1].strip() else []
        if not kept[-1].endswith((b"\n", b"\r")):
            kept[-1] += line_end
        found += [*kept, *(line + line_end for line in _lines(image, bent)), *blank]
    if found and missing and not found[-1].endswith((b"\n", b"\r")):
        found[-1] += line_end
    for name in missing:
        found += [line + line_end for line in definition(name, (), image, bent)]
    return b"".join(found)


def definition(
    name: bytes, statements: Iterable[bytes], image: bytes, bent: bytes | None
) -> list[bytes]:
    """The lines of a new material that looks its occlusion up in the image; white without statements."""
    given = list(statements) or [b"Kd 1 1 1"]
    return [b"newmtl " + name, b"Ka 1 1 1", *given, *_lines(image, bent)]


def _lines(image: bytes, bent: bytes | None) -> list[bytes]:
    lines = [b"map_Ka " + image, b"map_ao " + image]
    return lines if bent is None else [*lines, b"map_bent_normal " + bent]


def _definitions(library: bytes) -> list[list[bytes]]:
    """The lines of a library, in one piece for each material and one for what stands before the first."""
    found: list[list[bytes]] = [[]]
    for line in library.splitlines(keepends=True):
        if _keyword(line) == b"newmtl":
            found.append([])
        found[-1].append(line)
    return found


def _keyword(line: bytes) -> bytes:
    words = line.split(None, 1)
    return words[0].lower() if words else b""


def _name(line: bytes) -> bytes | None:
    words = line.strip().split(None, 1)
    return words[1] if len(words) == 2 and words[0].lower() == b"newmtl" else None

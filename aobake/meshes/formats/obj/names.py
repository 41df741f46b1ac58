"""Names of what is written beside an OBJ file."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from aobake.errors import OutputError

__all__ = ["Names", "names_beside", "word"]

LIBRARY = re.compile(
    rb"^[ \t]*mtllib[ \t]+([^\s/\\]+)", re.MULTILINE
)  # one of ours is a single word


@dataclass(frozen=True)
class Names:
    """Where the material library, the images and those of bent normals go."""

    library: Path
    images: tuple[Path, ...]
    bent: tuple[Path, ...]


def names_beside(
    target: Path, ending: str, images: int, bent: int, needed: Collection[Path]
) -> Names:
    """Names beside the target that are free, or that an earlier bake took for the same target.

    ending : of the images;  images, bent : how many;  needed : files that may not be replaced
    Raises OutputError where all are taken.
    """
    earlier = _mentioned(target)
    kept = {path.resolve() for path in needed} | {target.resolve()}

    def free(suffix: str) -> Path:
        for number in range(1, 1000):
            path = _named(target, suffix, number)
            ours = not path.exists() or path.name in earlier
            if ours and path.resolve() not in kept:
                kept.add(path.resolve())
                return path
        raise OutputError(f"{target}: every name for its {suffix} is taken. Write it elsewhere.")

    return Names(
        library=free(".mtl"),
        images=tuple(free(f"_ao{ending}") for _ in range(images)),
        bent=tuple(free(f"_bent_normal{ending}") for _ in range(bent)),
    )


def _mentioned(target: Path) -> set[str]:
    """What the file that stands at the target already names: its material libraries, and words of theirs."""
    if not target.is_file():
        return set()
    found: set[str] = set()
    for name in LIBRARY.findall(target.read_bytes()):
        library = target.with_name(name.decode("utf-8", "replace"))
        if library.is_file():
            found |= {library.name, *library.read_bytes().decode("utf-8", "replace").split()}
    return found


def _named(target: Path, suffix: str, number: int) -> Path:
    stem, dot, ending = suffix.rpartition(".")
    count = str(number) if number > 1 else ""
    return target.with_name(f"{word(target.stem)}{stem}{count}{dot}{ending}")


def word(name: str) -> str:
    """A name as one word: readers cut names at white space, and a # begins a comment."""
    joined = "_".join(name.replace("#", "_").replace("\\", "_").split())
    return "".join(letter for letter in joined if letter.isprintable())

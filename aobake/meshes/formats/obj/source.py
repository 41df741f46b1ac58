"""The document behind a scene that was read from an OBJ file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

__all__ = ["ObjSource"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjSource:
    """An OBJ file as it lies on disk.

    files : the file, then its material libraries and textures that exist
    text : its bytes
    found : what `facts` gives
    rational : whether free-form surfaces may need the weights of the vertices (v x y z w)
    five_numbers : vertex lines that have no place for a colour (v x y z and two more)
    """

    path: Path
    files: tuple[Path, ...]
    text: bytes
    found: Mapping[str, object]
    rational: bool = False
    five_numbers: int = 0

    @property
    def format(self) -> str:
        """'OBJ'."""
        return "OBJ"

    def facts(self) -> Mapping[str, object]:
        """What is in the file, for people."""
        return self.found

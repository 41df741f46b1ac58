"""The document behind a scene that was read from a PLY file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aobake.meshes.formats.ply.header import Header

__all__ = ["PlySource"]


@dataclass(frozen=True, eq=False, kw_only=True)
class PlySource:
    """A PLY file as it lies on disk.

    data : its bytes     header : what they mean     found : what `facts` gives
    """

    path: Path
    data: bytes
    header: Header
    found: Mapping[str, object]

    @property
    def format(self) -> str:
        """'PLY'."""
        return "PLY"

    @property
    def files(self) -> tuple[Path, ...]:
        """The file alone."""
        return (self.path,)

    def facts(self) -> Mapping[str, object]:
        """What is in the file, for people."""
        return self.found

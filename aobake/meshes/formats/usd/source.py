"""The stage that a scene was read from, and which prim each instance of the scene stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Binding", "UsdSource"]


@dataclass(frozen=True)
class Binding:
    """A mesh prim, as an instance of the scene shows it.

    path : of the prim on the stage
    instances : paths of the native instances that it stands in, from the outermost on; a layer can give
        it an opinion of its own only where these are no longer shared
    """

    path: str
    instances: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class UsdSource:
    """A USD file, and one binding for each instance of the scene, in its order.

    files : the file, then the layers that it is made of
    found : what `facts` gives
    was_baked : whether the file is itself a layer that aobake wrote
    """

    path: Path
    files: tuple[Path, ...]
    bindings: tuple[Binding, ...]
    found: Mapping[str, object]
    was_baked: bool = False

    @property
    def format(self) -> str:
        """'USD'."""
        return "USD"

    def facts(self) -> Mapping[str, object]:
        """What is on the stage, for people."""
        return self.found

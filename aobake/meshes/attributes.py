"""Attributes that are read when they are asked for, so that who needs none of them pays for none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from aobake.meshes.scene import Attribute

__all__ = ["DeferredAttributes"]


class DeferredAttributes(Mapping[str, Attribute]):
    """Attributes by name; the first look at one reads it, and raises what its reader raises.

    readers : name -> what reads the attribute. Names and their number are known without reading.
    """

    def __init__(self, readers: Mapping[str, Callable[[], Attribute]]) -> None:
        self._readers = dict(readers)
        self._read: dict[str, Attribute] = {}

    def __getitem__(self, name: str) -> Attribute:
        if name not in self._read:
            self._read[name] = self._readers[name]()
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._readers  # that of Mapping would read it

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

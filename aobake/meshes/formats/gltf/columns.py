"""Columns of vertex values: what primitives that share their vertices can share as well.

Exporters often give all primitives of a mesh the same vertices and different indices. Each of them
has values of its own for the vertices that it uses, and they fit into one column unless two of them
use the same vertex with different values.
"""

from __future__ import annotations

import hashlib
from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.places import Vertices

__all__ = ["ColumnPool"]

Column = NDArray[np.generic]
Mask = NDArray[np.bool_]

# How many earlier columns of the same vertices are tried for a fit. Primitives of one mesh follow each
# other, so the fit is found at once; without a limit a thousand instances would make half a million tries.
TRIES = 8


@dataclass(eq=False)
class _Domain:
    """Columns of one set of vertices.

    numbers : the columns;  known : digest of values and use -> column
    """

    numbers: list[int] = field(default_factory=list)
    known: dict[bytes, int] = field(default_factory=dict)


class ColumnPool:
    """Columns gathered so far, each to be stored once."""

    def __init__(self) -> None:
        self.columns: list[Column] = []
        self._used: list[Mask] = []
        self._domains: dict[Hashable, _Domain] = {}

    def place(self, vertices: Vertices, values: Column, faces: NDArray[np.int32]) -> int:
        """Number of the column that gives every vertex of the faces its value.

        values : (V, components), as stored;  faces : (F, 3) int32
        """
        alone = vertices.alone  # no other column could fit, so what is used does not matter
        used = np.zeros(0 if alone else len(values), np.bool_)
        if not alone:
            used[faces] = True
        found = self._domains.setdefault(vertices.domain, _Domain())
        digest = hashlib.blake2b(np.ascontiguousarray(values).data)
        digest.update(b"" if alone else np.packbits(used).tobytes())
        key = digest.digest()
        if key not in found.known:
            number = None if alone else self._fit(found, values, used)
            found.known[key] = self._add(found, values, used, alone) if number is None else number
        return found.known[key]

    def _fit(self, domain: _Domain, values: Column, used: Mask) -> int | None:
        for number in domain.numbers[-TRIES:]:
            both = self._used[number] & used
            if np.array_equal(self.columns[number][both], values[both]):
                self.columns[number][used] = values[used]
                self._used[number] |= used
                return number
        return None

    def _add(self, domain: _Domain, values: Column, used: Mask, alone: bool) -> int:
        self.columns.append(values if alone else values.copy())
        self._used.append(used if alone else used.copy())
        domain.numbers.append(len(self.columns) - 1)
        return len(self.columns) - 1

"""Faces cut into parts of like size with short cuts between them: METIS, or halves by the longest axis.

Source: G. Karypis, V. Kumar, A fast and high quality multilevel scheme for partitioning irregular
graphs, 1998.
"""

from __future__ import annotations

import numpy as np

from aobake.atlas.dual import Dual
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["parts_of"]

SEED = 1
FINEST = 1000.0  # METIS weighs in whole numbers: the mean edge, and a thousand times the mean face


def parts_of(dual: Dual, chosen: IntArray, count: int) -> IntArray:
    """(N,) int32 part, below `count`, of each of the chosen faces (N,), no part empty.

    Parts have like shares of the area and of the number of faces. They need not be connected.
    """
    count = min(count, len(chosen))
    if count < 2:
        return np.zeros(len(chosen), np.int32)
    found = _by_metis(dual, chosen, count)
    return _by_axes(dual.center[chosen], count) if found is None else found


def _by_metis(dual: Dual, chosen: IntArray, count: int) -> IntArray | None:
    """None where METIS is missing, or left a part empty."""
    try:
        import pymetis
    except ImportError:  # no wheel for Windows
        return None
    number = np.full(len(dual.opposite), -1, np.int64)
    number[chosen] = np.arange(len(chosen))
    other = np.where(dual.opposite[chosen] >= 0, number[dual.opposite[chosen] // 3], -1)
    inner = other >= 0
    cost = dual.cost[chosen][inner]
    weight = np.maximum(FINEST * cost / max(float(cost.mean()), 1e-300), 1.0) if len(cost) else cost
    area = dual.area[chosen]
    size = 0.5 * FINEST * (1.0 + area / area.mean())
    _, part = pymetis.part_graph(
        count,
        pymetis.CSRAdjacency(np.concatenate([[0], np.cumsum(inner.sum(axis=1))]), other[inner]),
        eweights=np.minimum(weight, 1e6).astype(np.int64),
        vweights=np.minimum(size, 1e9 / len(chosen)).astype(np.int64) + 1,
        options=pymetis.Options(seed=SEED),
    )
    found = np.asarray(part, np.int32)
    return found if len(np.unique(found)) == count else None


def _by_axes(centers: FloatArray, count: int) -> IntArray:
    """Halves along the longest axis, again and again."""
    part = np.zeros(len(centers), np.int32)
    pending = [(np.arange(len(centers)), 0, count)]
    while pending:
        rows, first, parts = pending.pop()
        part[rows] = first
        if parts > 1:
            at = centers[rows]
            axis = int(np.argmax(at.max(axis=0) - at.min(axis=0)))
            order = rows[np.argsort(at[:, axis], kind="stable")]
            lower = parts // 2
            middle = min(max(len(rows) * lower // parts, lower), len(rows) - (parts - lower))
            pending += [
                (order[:middle], first, lower),
                (order[middle:], first + lower, parts - lower),
            ]
    return part

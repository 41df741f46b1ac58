"""The linear system of a least-squares fit on triangles. The one file that imports scipy's sparse solver.

Source: L. Kavan, A. Bargteil, P.-P. Sloan, Least squares vertex baking, Computer Graphics Forum 30(4)
(EGSR), 2011. Two things differ: the mass matrix is summed over the samples themselves instead of in
closed form, which reproduces constants to the last digit from few samples; the jump of the gradient
across an edge is that of its part across the edge (the part along it cannot jump), weighed by the heights
of both triangles, so that needles do not stiffen the mesh.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from aobake.leastsquares.triangles import FittedTriangles
from aobake.meshes.scene import FloatArray

__all__ = ["Matrix", "jump_matrix", "mass_matrix", "right_side", "solver"]

IntArray = NDArray[np.int64]
Matrix = csc_matrix

# Share of the jumps in what is minimised: 0.02 costs a tenth of the gain, without any single vertices swing.
SMOOTHNESS = 0.002
LUMPED = 0.02  # share of the mass that is a vertex's own: three samples in a row do not settle three corners


def mass_matrix(
    corners: IntArray, basis: FloatArray, weights: FloatArray, count: int
) -> csc_matrix:
    """(count, count) sums over samples of weight times the products of their corners' basis functions.

    corners : (S, 3) unknowns; basis : (S, 3) their barycentric weights; weights : (S,)
    """
    products = weights[:, None, None] * basis[:, :, None] * basis[:, None, :]
    rows = np.broadcast_to(corners[:, :, None], products.shape)
    columns = np.broadcast_to(corners[:, None, :], products.shape)
    return csc_matrix(
        (products.reshape(-1), (rows.reshape(-1), columns.reshape(-1))), shape=(count, count)
    )


def right_side(
    corners: IntArray, basis: FloatArray, weighted: FloatArray, count: int
) -> FloatArray:
    """(count,) sums over samples of their weighted values (S,) times the corners' basis functions."""
    sums = np.bincount(
        corners.reshape(-1), (weighted[:, None] * basis).reshape(-1), minlength=count
    )
    return np.asarray(sums, np.float64)


def jump_matrix(triangles: FittedTriangles) -> csc_matrix:
    """(U, U) the squared jumps of the gradient across all edges that two triangles share, by their areas."""
    rows, columns, values, weights = _jumps(triangles)
    across = csc_matrix(
        (values.reshape(-1), (rows.reshape(-1), columns.reshape(-1))),
        shape=(len(weights), triangles.unknowns),
    )
    return (across.T @ across.multiply(weights[:, None]).tocsc()).tocsc()


def _jumps(
    triangles: FittedTriangles,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """(E, 4) rows, unknowns and factors of the jump across each shared edge, and (E,) its area."""
    left, right = _shared_edges(triangles.corners)
    foot_l, height_l = _apex(triangles.places, left)
    foot_r, height_r = _apex(triangles.places, right)
    sums = height_l + height_r
    sums[sums == 0.0] = 1.0
    to_l, to_r = 2.0 * height_r / sums, 2.0 * height_l / sums  # 2 h h' / (h + h'), over each height
    corners = triangles.corners
    face_l, side_l = left.T
    face_r, side_r = right.T
    columns = np.stack(
        [
            corners[face_l, side_l],
            corners[face_l, (side_l + 1) % 3],
            corners[face_l, (side_l + 2) % 3],
            corners[face_r, (side_r + 2) % 3],
        ],
        axis=1,
    )
    same_way = corners[face_r, side_r] == columns[:, 0]
    foot_r = np.where(same_way, foot_r, 1.0 - foot_r)
    values = np.stack(
        [
            to_l * (1.0 - foot_l) + to_r * (1.0 - foot_r),
            to_l * foot_l + to_r * foot_r,
            -to_l,
            -to_r,
        ],
        axis=1,
    )
    rows = np.broadcast_to(np.arange(len(left))[:, None], columns.shape)
    return rows, columns, values, triangles.areas[face_l] + triangles.areas[face_r]


def _shared_edges(corners: IntArray) -> tuple[IntArray, IntArray]:
    """(E, 2) and (E, 2): triangle and side of the two users of each edge that has exactly two."""
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ordered = ends[order]
    starts = np.flatnonzero(np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)][: len(ordered)])
    twice = np.diff(np.r_[starts, len(ordered)]) == 2
    first, second = order[starts[twice]], order[starts[twice] + 1]
    proper = ends[first, 0] != ends[first, 1]
    first, second = first[proper], second[proper]
    return np.stack(np.divmod(first, 3), axis=1), np.stack(np.divmod(second, 3), axis=1)


def _apex(places: FloatArray, sides: IntArray) -> tuple[FloatArray, FloatArray]:
    """Where along an edge the foot of the third corner lies (0 to 1 between its ends), and its height."""
    face, side = sides.T
    a = places[face, side]
    edge, up = places[face, (side + 1) % 3] - a, places[face, (side + 2) % 3] - a
    squared = np.einsum("ij,ij->i", edge, edge)
    foot = np.einsum("ij,ij->i", edge, up) / np.where(squared > 0.0, squared, 1.0)
    return foot, np.linalg.norm(up - foot[:, None] * edge, axis=1)


def solver(mass: csc_matrix, jumps: csc_matrix) -> Callable[[FloatArray], FloatArray]:
    """What gives, for right sides (U,) or (U, K), the values that fit best; 0 where nothing is known.

    A share of each vertex's mass pulls it to the mean of the samples around it, whose sum is the right
    side itself.
    """
    count = mass.shape[0]
    own = np.asarray(mass.sum(axis=1)).reshape(-1)
    own = np.where(own > 0.0, own, 1.0)
    numbers = np.arange(count)
    lumped = csc_matrix((LUMPED * own, (numbers, numbers)), shape=(count, count))
    factors = splu(
        (mass + SMOOTHNESS * jumps + lumped).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )

    def solve(right: FloatArray) -> FloatArray:
        found: FloatArray = factors.solve((1.0 + LUMPED) * right)
        return found

    return solve

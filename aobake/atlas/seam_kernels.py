"""Products with the matrix of seam equations, which is never built."""

from __future__ import annotations

from aobake.tracing.compiled import kernel

__all__ = ["add_normal_product"]


@kernel
def add_normal_product(texel, weight, x, product):
    """Add A^T A x, where each row of A is one equation.

    texel : (S, K) int32, the unknowns of each equation; weight : (S, K) float64, their factors
    x, product : (N,) float64
    """
    for row in range(len(texel)):
        step = 0.0
        for k in range(texel.shape[1]):
            step += weight[row, k] * x[texel[row, k]]
        for k in range(texel.shape[1]):
            product[texel[row, k]] += weight[row, k] * step

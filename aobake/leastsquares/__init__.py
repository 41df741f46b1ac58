"""Values at vertices that make the interpolated occlusion right, instead of the values at the vertices."""

from __future__ import annotations

from aobake.leastsquares.fit import fitted_vertices

__all__ = ["fitted_vertices"]

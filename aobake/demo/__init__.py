"""The showpiece: a scene made of arrays, so that everything can be tried without an asset at hand."""

from __future__ import annotations

from aobake.demo.hall import hall

__all__ = ["hall"]

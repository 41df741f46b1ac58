"""Tracing: Embree, and the compiled loops that ask it. Arrays only: no files, no scenes."""

from __future__ import annotations

__all__: list[str] = []

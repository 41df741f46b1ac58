"""Meshes: the scene, its normals, and the files it comes from and goes to."""

from __future__ import annotations

__all__: list[str] = []

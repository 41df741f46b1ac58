"""Wavefront OBJ: read by statements, written by adding colours to its own vertex lines.

Source: Wavefront, Advanced Visualizer Manual, appendix B1; vertex colours as in ZBrush and MeshLab.
"""

from aobake.meshes.formats.obj.reading import read
from aobake.meshes.formats.obj.writing import check, write

__all__ = ["check", "read", "write"]

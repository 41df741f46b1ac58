"""Wavefront OBJ: read by statements, written by adding to its own lines.

Source: Wavefront, Advanced Visualizer Manual, appendix B1; vertex colours as in ZBrush and MeshLab.
"""

from aobake.meshes.formats.obj.lightmap import check_texture, write_texture
from aobake.meshes.formats.obj.reading import read
from aobake.meshes.formats.obj.writing import check, write

__all__ = ["check", "check_texture", "read", "write", "write_texture"]

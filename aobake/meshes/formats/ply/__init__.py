"""PLY, ascii and binary of either order: read whole, written by adding properties to its own vertices.

Source: Turk, The PLY Polygon File Format, 1994.
"""

from aobake.meshes.formats.ply.reading import read
from aobake.meshes.formats.ply.writing import check, write

__all__ = ["check", "read", "write"]

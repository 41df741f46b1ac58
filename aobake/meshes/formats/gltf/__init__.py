"""glTF 2.0 and GLB: read with every value as it is stored, written by editing the document."""

from __future__ import annotations

from aobake.meshes.formats.gltf.read import read
from aobake.meshes.formats.gltf.write import check, check_texture, write, write_texture

__all__ = ["check", "check_texture", "read", "write", "write_texture"]

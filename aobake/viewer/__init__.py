"""One HTML page that shows an asset with its ambient occlusion, and needs nothing but itself."""

from __future__ import annotations

from aobake.viewer.asset import Packed, packed_glb
from aobake.viewer.page import page_of

__all__ = ["Packed", "packed_glb", "page_of"]

"""Bakes to textures: decided, traced in bands that may be anywhere, and put together."""

from __future__ import annotations

from aobake.lightmaps.bake import bake_texture, prepare_texture
from aobake.lightmaps.bands import Band, TextureBake, TracedBand, bands_of
from aobake.lightmaps.pages import put_together
from aobake.lightmaps.texels import trace_bands

__all__ = [
    "Band",
    "TextureBake",
    "TracedBand",
    "bake_texture",
    "bands_of",
    "prepare_texture",
    "put_together",
    "trace_bands",
]

"""The atlas: where surfaces lie on an image, which texels they cover, and what is done to those."""

from __future__ import annotations

__all__: list[str] = []

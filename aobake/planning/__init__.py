"""What the plan of a bake is made of: one file for each kind of effect, and what a bake will cost."""

from __future__ import annotations

__all__: list[str] = []

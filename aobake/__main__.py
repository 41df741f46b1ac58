"""`python -m aobake` is the command `aobake`."""

from __future__ import annotations

from aobake.cli import entry

__all__: list[str] = []

if __name__ == "__main__":
    entry()

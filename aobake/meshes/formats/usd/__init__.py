"""Universal Scene Description: read through Pixar's own library, written as a layer over the untouched file.

Needs the package usd-core (the extra `usd`), whose one import site is stage.py.
"""

from aobake.meshes.formats.usd.reading import available, read
from aobake.meshes.formats.usd.writing import check, write

__all__ = ["available", "check", "read", "write"]

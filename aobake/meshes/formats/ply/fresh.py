"""A new PLY file from a merged scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.merged import Merged
from aobake.meshes.formats.ply.columns import AO, COLOR, MEAN_DISTANCE, byte_colors
from aobake.meshes.scene import FloatArray
from aobake.settings import StoreSettings

__all__ = ["document"]

NAMES = {"u1": "uchar", "f4": "float", "f8": "double"}


def document(
    mesh: Merged, store: StoreSettings, distance: NDArray[np.float32] | None = None
) -> list[bytes]:
    """The pieces of a binary PLY file (little endian): vertices, normals where given, colours, ao, faces.

    distance : (V,) mean distances, for which there is a property as well; or None
    Coordinates are floats where those are the same numbers, else doubles.
    """
    columns = [("x", 0), ("y", 1), ("z", 2)]
    exact = _coordinate_type(mesh.vertices)
    fields = [(name, exact) for name, _ in columns]
    if mesh.normals is not None:
        fields += [(name, "f4") for name in ("nx", "ny", "nz")]
    if store.store == "color":
        fields += [(name, "u1") for name in COLOR]
    fields.append((AO, "f4"))
    if distance is not None:
        fields.append((MEAN_DISTANCE, "f4"))
    rows = np.empty(len(mesh.vertices), np.dtype([(name, "<" + type_) for name, type_ in fields]))
    for name, axis in columns:
        rows[name] = mesh.vertices[:, axis]
        if mesh.normals is not None:
            rows["n" + name] = mesh.normals[:, axis]
    if store.store == "color":
        for name in COLOR:
            rows[name] = byte_colors(mesh.ao)
    rows[AO] = mesh.ao
    if distance is not None:
        rows[MEAN_DISTANCE] = distance
    return [_header(fields, len(rows), len(mesh.faces)), rows.tobytes(), _faces(mesh)]


def _coordinate_type(vertices: FloatArray) -> str:
    with np.errstate(over="ignore", invalid="ignore"):
        return (
            "f4" if np.array_equal(vertices.astype(np.float32), vertices, equal_nan=True) else "f8"
        )


def _faces(mesh: Merged) -> bytes:
    rows = np.empty(len(mesh.faces), np.dtype([("count", "u1"), ("corners", "<i4", (3,))]))
    rows["count"] = 3
    rows["corners"] = mesh.faces
    return rows.tobytes()


def _header(fields: list[tuple[str, str]], vertices: int, faces: int) -> bytes:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment aobake: ambient occlusion in ao, 1 = open, 0 = fully occluded",
        f"element vertex {vertices}",
        *(f"property {NAMES[type_]} {name}" for name, type_ in fields),
        f"element face {faces}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    return "\n".join(lines).encode()

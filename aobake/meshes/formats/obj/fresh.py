"""A new OBJ file from a merged scene."""

from __future__ import annotations

from aobake.meshes.formats.merged import Merged
from aobake.meshes.formats.obj.names import word

__all__ = ["document"]


def document(mesh: Merged) -> bytes:
    """The text of an OBJ file: one object per instance, colours on its vertices, normals where given.

    Coordinates are written with as many digits as give the same float64 again.
    """
    lines = ["# aobake: ambient occlusion as vertex colors (v x y z r g b)"]
    vertex = face = 0
    for number, part in enumerate(mesh.parts):
        lines.append(f"o {word(part.name) or f'part_{number}'}")
        lines += _vertices(mesh, vertex, vertex + part.vertices)
        lines += _faces(mesh, face, face + part.faces)
        vertex += part.vertices
        face += part.faces
    return ("\n".join(lines) + "\n").encode()


def _vertices(mesh: Merged, begin: int, end: int) -> list[str]:
    lines = [
        f"v {x!r} {y!r} {z!r} {value:.6g} {value:.6g} {value:.6g}"
        for (x, y, z), value in zip(
            mesh.vertices[begin:end].tolist(), mesh.ao[begin:end].tolist(), strict=True
        )
    ]
    if mesh.normals is not None:
        lines += [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.normals[begin:end].tolist()]
    return lines


def _faces(mesh: Merged, begin: int, end: int) -> list[str]:
    faces = (mesh.faces[begin:end].astype("int64") + 1).tolist()
    if mesh.normals is None:
        return [f"f {a} {b} {c}" for a, b, c in faces]
    return [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in faces]

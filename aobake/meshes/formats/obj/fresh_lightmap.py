"""A new OBJ file with a lightmap, for a scene that was read from no OBJ file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aobake.errors import OutputError
from aobake.meshes.formats.merged import Merged, merged
from aobake.meshes.formats.obj.coordinates import vt_lines
from aobake.meshes.formats.obj.library import definition
from aobake.meshes.formats.obj.names import Names, word
from aobake.meshes.lightmap import Lightmap, Placing, Unwrapped
from aobake.meshes.scene import FloatArray, IntArray, Material, Mesh, Scene

__all__ = ["fresh_lightmap"]


def fresh_lightmap(
    scene: Scene, lightmap: Lightmap, names: Names, target: Path
) -> dict[Path, bytes]:
    """The text of the OBJ file and of its material library: one object per instance.

    Positions are written with as many digits as give the same float64 again. Raises OutputError where
    coordinates are kept that there are not.
    """
    whole = merged(scene, [np.ones(len(mesh.vertices), np.float32) for _, mesh in scene.placed()])
    lines = [
        b"# aobake: ambient occlusion in map_Ka and map_ao",
        b"mtllib " + _bytes(names.library),
    ]
    used: dict[tuple[int | None, int], bytes] = {}
    first = np.zeros(3, np.int64)  # vertex, face and coordinate that come next
    for number, ((instance, mesh), placing) in enumerate(
        zip(scene.placed(), lightmap.placings, strict=True)
    ):
        title = word(instance.name or mesh.name) or f"part_{number}"
        lines.append(f"o {title}".encode())
        lines += _vertices(whole, int(first[0]), len(mesh.vertices))
        if placing is not None:
            uv, corners = _coordinates(mesh, placing, target)
            key = mesh.material, placing.page
            used.setdefault(key, _material_name(scene, *key))
            lines += [*vt_lines(uv), b"usemtl " + used[key]]
            lines += _faces(whole, mesh, corners, first)
            first[2] += len(uv)
        first[:2] += len(mesh.vertices), len(mesh.faces)
    library = [
        line
        for (material, page), name in used.items()
        for line in definition(
            name,
            () if material is None else _statements(scene.materials[material]),
            _bytes(names.images[page]),
            _bytes(names.bent[page]) if names.bent else None,
        )
    ]
    return {
        names.library: b"\n".join([*library, b""]),
        target: b"\n".join([*lines, b""]),
    }


def _bytes(path: Path) -> bytes:
    return path.name.encode()


def _coordinates(mesh: Mesh, placing: Placing, target: Path) -> tuple[FloatArray, IntArray]:
    """(N, 2) texture coordinates, and (F, 3) which of them each corner of a face has."""
    layout = placing.layout
    if isinstance(layout, Unwrapped):
        return layout.uv, layout.faces
    found = mesh.attributes.get(f"TEXCOORD_{layout.uv_set}")
    if found is None:
        raise OutputError(
            f"{target}: mesh {mesh.name!r} has no TEXCOORD_{layout.uv_set} to keep. Unwrap it."
        )
    return found.values, mesh.faces if found.corners is None else found.corners


def _vertices(whole: Merged, begin: int, count: int) -> Iterator[bytes]:
    rows = slice(begin, begin + count)
    for x, y, z in whole.vertices[rows].tolist():
        yield f"v {x!r} {y!r} {z!r}".encode()
    if whole.normals is not None:
        for x, y, z in whole.normals[rows].tolist():
            yield b"vn %.9g %.9g %.9g" % (x, y, z)


def _faces(
    whole: Merged, mesh: Mesh, corners: IntArray, first: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> Iterator[bytes]:
    faces = whole.faces[int(first[1]) : int(first[1]) + len(mesh.faces)].astype(np.int64) + 1
    mirrored = not np.array_equal(faces, mesh.faces + (first[0] + 1))
    textures = corners[:, ::-1] if mirrored else corners
    textures = textures + (first[2] + 1)
    for (a, b, c), (i, j, k) in zip(faces.tolist(), textures.tolist(), strict=True):
        if whole.normals is None:
            yield b"f %d/%d %d/%d %d/%d" % (a, i, b, j, c, k)
        else:
            yield b"f %d/%d/%d %d/%d/%d %d/%d/%d" % (a, i, a, b, j, b, c, k, c)


def _material_name(scene: Scene, material: int | None, page: int) -> bytes:
    title = "ambient_occlusion"
    if material is not None:
        title = word(scene.materials[material].name) or "material"
        same = [other.name for other in scene.materials].count(scene.materials[material].name)
        title += f"_{material}" if same > 1 else ""
    return (f"{title}_{page + 1}" if page else title).encode()


def _statements(material: Material) -> Iterator[bytes]:
    red, green, blue, alpha = material.base_color
    yield b"Kd %.6g %.6g %.6g" % (red, green, blue)
    if any(material.emissive):
        yield b"Ke %.6g %.6g %.6g" % material.emissive
    yield b"Pr %.6g" % material.roughness
    yield b"Pm %.6g" % material.metallic
    if material.alpha_mode == "BLEND":
        yield b"d %.6g" % alpha

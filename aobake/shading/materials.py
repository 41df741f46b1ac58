"""What surfaces look like where rays hit them: colour, alpha, light of their own, baked occlusion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import IntArray, Material, Mesh, Scene, Texture
from aobake.shading.seen import Seen
from aobake.shading.textures import TextureStore

__all__ = [
    "Appearance",
    "Baked",
    "Look",
    "OcclusionSource",
    "appearance",
    "look_of",
    "occlusion_source",
]

Float32Array = NDArray[np.float32]
OcclusionSource = Literal["given", "attribute", "texture", "none"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Baked:
    """Ambient occlusion at vertices that is not in the asset, as bake_vertices gives it.

    ao, standard_error : one (V_i,) float32 array per instance, in the scene's order
    """

    ao: Sequence[Float32Array]
    standard_error: Sequence[Float32Array] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Appearance:
    """Of N points: albedo, emitted and bent (or None) (3, N), alpha, ao and error (N,), all float32, linear."""

    albedo: Float32Array
    alpha: Float32Array
    emitted: Float32Array
    ao: Float32Array
    error: Float32Array
    bent: Float32Array | None


@dataclass(frozen=True, eq=False)
class _Values:
    """An attribute of a mesh, (k, V), and which columns of it the corners of each face have, (F, 3)."""

    values: Float32Array
    rows: IntArray

    def at(self, part: _Part) -> Float32Array:
        """(k, N) at points."""
        return _at(self.values, self.rows, part)


@dataclass(frozen=True, eq=False, kw_only=True)
class Look:
    """What is needed to tell the appearance of a point, read once.

    mesh_of : (instances,) the mesh of each instance
    values : per mesh, name of an attribute -> its values
    occlusion : per mesh, where baked occlusion is taken from
    warnings : what could not be read, one line each
    """

    scene: Scene
    mesh_of: NDArray[np.int64]
    baked: Baked | None
    textures: TextureStore
    values: Sequence[dict[str, _Values]]
    occlusion: Sequence[OcclusionSource]
    warnings: tuple[str, ...]

    @property
    def has_bent_normals(self) -> bool:
        """Whether any mesh has the attribute _BENT_NORMAL."""
        return any("_BENT_NORMAL" in values for values in self.values)

    @property
    def see_through(self) -> bool:
        """Whether there may be holes in, or light through, any surface."""
        return any(_material(self.scene, mesh).alpha_mode != "OPAQUE" for mesh in self.scene.meshes)


def look_of(scene: Scene, baked: Baked | None, longest_side: int) -> Look:
    """Read the attributes that a picture needs. What is broken is left out, with a warning.

    longest_side : of the picture, in pixels
    Raises InputError where the shapes of `baked` are not those of the scene.
    """
    if baked is not None:
        _check_shapes(scene, baked)
    values: list[dict[str, _Values]] = []
    warnings = []
    for number, mesh in enumerate(scene.meshes):
        found = {}
        for name in _wanted(scene, mesh):
            try:
                found[name] = _read(mesh, name)
            except InputError as error:
                warnings.append(f"mesh {mesh.name or number!r}: {name} is not shown: {error}")
        values.append(found)
    sources = [occlusion_source(scene, mesh, given=baked is not None) for mesh in scene.meshes]
    textures = TextureStore(scene, longest_side)
    return Look(
        scene=scene,
        mesh_of=np.array([instance.mesh for instance in scene.instances], np.int64),
        baked=baked,
        textures=textures,
        values=values,
        occlusion=sources,
        warnings=tuple(warnings),
    )


def _check_shapes(scene: Scene, baked: Baked) -> None:
    wanted = [(len(mesh.vertices),) for _, mesh in scene.placed()]
    for name, values in (("ao", baked.ao), ("standard_error", baked.standard_error)):
        if values is not None and [np.shape(each) for each in values] != wanted:
            raise InputError(
                f"{name} does not fit the scene; one array for each of its {len(wanted)} instances "
                "is needed, with a value for each vertex."
            )


def occlusion_source(scene: Scene, mesh: Mesh, *, given: bool) -> OcclusionSource:
    """Where the baked occlusion of a mesh is: what is given goes before what the file holds.

    Of what a file holds, _AO goes before an occlusion texture: it is a bake's own and not rounded.
    """
    if given:
        return "given"
    if "_AO" in mesh.attributes:
        return "attribute"
    texture = _material(scene, mesh).occlusion_texture
    return "texture" if texture is not None and _uv_name(texture) in mesh.attributes else "none"


def appearance(look: Look, seen: Seen) -> Appearance:
    """The appearance of points."""
    count = len(seen.face)
    found = Appearance(
        albedo=np.ones((3, count), np.float32),
        alpha=np.ones(count, np.float32),
        emitted=np.zeros((3, count), np.float32),
        ao=np.ones(count, np.float32),
        error=np.zeros(count, np.float32),
        bent=np.zeros((3, count), np.float32) if look.has_bent_normals else None,
    )
    mesh_of = look.mesh_of[seen.instance]
    for mesh, rows in _groups(mesh_of):
        _paint(look, mesh, _Part(seen.face[rows], seen.weights[:, rows]), rows, found)
    if look.baked is not None:
        for number, rows in _groups(seen.instance):
            part = _Part(seen.face[rows], seen.weights[:, rows])
            faces = look.scene.meshes[look.mesh_of[number]].faces
            found.ao[rows] = _at(look.baked.ao[number][None], faces, part)[0]
            if look.baked.standard_error is not None:
                error = look.baked.standard_error[number]
                found.error[rows] = _at(error[None], faces, part)[0]
    return found


@dataclass(frozen=True, eq=False)
class _Part:
    """Points of one mesh: face (N,), weights (3, N) float32 of its corners."""

    face: NDArray[np.int32]
    weights: Float32Array


def _groups(
    numbers: NDArray[np.int64],
) -> Iterator[tuple[int, slice | NDArray[np.int64]]]:
    """Each number that occurs, with the rows where it does."""
    if len(numbers) == 0:
        return
    if numbers.min() == numbers.max():
        yield int(numbers[0]), slice(None)
        return
    order = np.argsort(numbers, kind="stable")
    ordered = numbers[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=-1))
    for first, end in zip(starts, [*starts[1:], len(order)], strict=True):
        yield int(ordered[first]), order[first:end]


def _at(values: Float32Array, rows: IntArray, part: _Part) -> Float32Array:
    """(k, N) of values (k, V), whose corners are rows (F, 3), interpolated."""
    corners = np.take(rows, part.face, axis=0)
    a, b, c = (part.weights[k] * np.take(values, corners[:, k], axis=1) for k in range(3))
    return np.asarray(a + b + c)


def _paint(
    look: Look, mesh: int, part: _Part, rows: slice | NDArray[np.int64], found: Appearance
) -> None:
    """Fill in the rows of one mesh."""
    material, values = _material(look.scene, look.scene.meshes[mesh]), look.values[mesh]
    color = np.array(material.base_color, np.float32)[:, None]
    if "COLOR_0" in values:
        own = values["COLOR_0"].at(part)
        color = color * (own if len(own) == 4 else np.concatenate([own, np.ones_like(own[:1])]))
    texel = _texel(look, values, material.base_color_texture, part, srgb=True)
    if texel is not None:
        color = color * texel
    found.albedo[:, rows] = np.clip(color[:3], 0.0, 1.0)
    if material.alpha_mode != "OPAQUE":
        found.alpha[rows] = _alpha(material, color[3])
    if any(material.emissive):
        glow = np.array(material.emissive, np.float32)[:, None]
        texel = _texel(look, values, material.emissive_texture, part, srgb=True)
        found.emitted[:, rows] = glow if texel is None else glow * texel[:3]
    if look.occlusion[mesh] == "attribute" and "_AO" in values:
        found.ao[rows] = np.clip(values["_AO"].at(part)[0], 0.0, 1.0)
    elif look.occlusion[mesh] == "texture":
        texel = _texel(look, values, material.occlusion_texture, part, srgb=False)
        if texel is not None:
            strength = np.float32(material.occlusion_strength)
            found.ao[rows] = np.clip(1.0 + strength * (texel[0] - 1.0), 0.0, 1.0)
    if found.bent is not None and "_BENT_NORMAL" in values:
        found.bent[:, rows] = values["_BENT_NORMAL"].at(part)[:3]


def _texel(
    look: Look, values: dict[str, _Values], texture: Texture | None, part: _Part, *, srgb: bool
) -> Float32Array | None:
    """(4, N) of a texture; None where there is none that can be looked up."""
    if texture is None or _uv_name(texture) not in values:
        return None
    uv = values[_uv_name(texture)].at(part)[:2]
    found = look.textures.lookup(texture, uv.T.astype(np.float64), srgb=srgb)
    return None if found is None else found.T


def _alpha(material: Material, alpha: Float32Array) -> Float32Array:
    if material.alpha_mode == "MASK":
        return np.asarray(alpha >= material.alpha_cutoff, np.float32)
    return np.clip(alpha, 0.0, 1.0)


def _material(scene: Scene, mesh: Mesh) -> Material:
    return _PLAIN if mesh.material is None else scene.materials[mesh.material]


_PLAIN = Material()


def _uv_name(texture: Texture) -> str:
    return f"TEXCOORD_{texture.uv_set}"


def _wanted(scene: Scene, mesh: Mesh) -> list[str]:
    """Names of the attributes that the mesh has and a picture needs."""
    material = _material(scene, mesh)
    textures = (
        material.base_color_texture,
        material.emissive_texture if any(material.emissive) else None,
        material.occlusion_texture,
    )
    names = ["COLOR_0", "_AO", "_BENT_NORMAL"]
    names += [_uv_name(texture) for texture in textures if texture is not None]
    return [name for name in dict.fromkeys(names) if name in mesh.attributes]


def _read(mesh: Mesh, name: str) -> _Values:
    attribute = mesh.attributes[name]
    rows = mesh.faces if attribute.corners is None else attribute.corners
    return _Values(np.ascontiguousarray(attribute.values.T, np.float32), rows)

"""A scene: meshes, where they stand, what they are made of, and the document they came from.

Arrays are made read-only; a scene never changes once it is built.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from aobake.errors import InputError
from aobake.meshes.arrays import (
    FloatArray,
    IntArray,
    array_of,
    frozen,
    placement,
    rows_of_three,
    triangles_among,
)
from aobake.meshes.materials import AlphaMode, Image, Material, Texture, Wrap
from aobake.meshes.motion import Motion

if TYPE_CHECKING:
    import trimesh

__all__ = [
    "AlphaMode",
    "Attribute",
    "Camera",
    "FloatArray",
    "Image",
    "Instance",
    "IntArray",
    "Light",
    "LightKind",
    "Material",
    "Mesh",
    "Motion",
    "Scene",
    "Source",
    "Texture",
    "Wrap",
]

LightKind = Literal["directional", "point", "spot"]

MOST_VERTICES = 2**31 - 1  # Embree's and our indices are 32 bits wide


class Source(Protocol):
    """The document that a scene was read from, kept whole so that a result can be written back into it."""

    @property
    def path(self) -> Path:
        """The file that was opened."""

    @property
    def format(self) -> str:
        """'GLB', 'glTF', 'OBJ', 'PLY', ..."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The file that was opened, then every file it refers to and that exists."""

    def facts(self) -> Mapping[str, object]:
        """What is in the document, for people: 'scenes', 'nodes', 'materials', 'attributes', ... -> value."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A camera of an asset; it looks along -z of its space, +y is up.

    transform : (4, 4) float64, from its space to the scene's
    yfov_rad : the full vertical angle of a perspective one; None: an orthographic one
    height : of the picture of an orthographic one, in scene units
    """

    name: str = ""
    transform: FloatArray
    yfov_rad: float | None
    height: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", placement(self.transform, "camera", self.name))


@dataclass(frozen=True, eq=False, kw_only=True)
class Light:
    """A light of an asset; a directional one and a spot shine along -z of its space.

    color : linear; intensity : candela (point, spot) or lux (directional), as glTF has them
    range : distance beyond which it is not seen, in scene units; None: there is none
    cone_rad : half angles at which the light of a spot begins to fade and is gone
    """

    kind: LightKind
    transform: FloatArray
    name: str = ""
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    range: float | None = None
    cone_rad: tuple[float, float] = (0.0, np.pi / 4)

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", placement(self.transform, "light", self.name))


@dataclass(frozen=True, eq=False, kw_only=True)
class Attribute:
    """Values on a surface, interpolated between the corners of its triangles.

    values : (N, k) float64
    corners : (F, 3) int32, the row of each corner of each face; None: that of its vertex
    """

    values: FloatArray
    corners: IntArray | None = None

    def __post_init__(self) -> None:
        values = np.asarray(self.values, np.float64)
        if values.ndim != 2:
            raise InputError(f"values of an attribute are (N, k), not {values.shape}.")
        object.__setattr__(self, "values", frozen(values))
        if self.corners is not None:
            corners = triangles_among(self.corners, len(values), "attribute")
            object.__setattr__(self, "corners", frozen(corners))


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh:
    """Triangles in their own space.

    vertices : (V, 3) float64, any value; vertices that are not finite are passed over and reported
    faces : (F, 3) int32, counter-clockwise as seen from their front
    normals : (V, 3) float64 of any length, or None where the file gives none
    flat_shaded : whether a mesh without normals is meant to show facets (glTF), so that coincident
        vertices of different faces keep normals of their own; else they are smoothed up to an angle
    material : index into the scene's materials, or None
    attributes : what else is on the surface, under the names and with the meaning that glTF gives them:
        TEXCOORD_n (u, v; v runs down from an image's top edge), COLOR_n (3 or 4, linear), TANGENT (x, y, z,
        and the bitangent's sign), _AO (1), _BENT_NORMAL (3, turned like normals), _MEAN_DISTANCE (1). May read
        a value when it is asked for, and then raise InputError
    extras : what applications have noted there, by their keys
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None = None
    name: str = ""
    flat_shaded: bool = False
    material: int | None = None
    attributes: Mapping[str, Attribute] = field(default_factory=dict)
    extras: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"mesh {self.name!r}" if self.name else "mesh"
        vertices = rows_of_three(self.vertices, np.float64, f"{where}: vertices")
        if len(vertices) > MOST_VERTICES:
            raise InputError(
                f"{where} has {len(vertices)} vertices; at most {MOST_VERTICES} can be baked."
            )
        faces = triangles_among(self.faces, len(vertices), where)
        object.__setattr__(self, "vertices", frozen(vertices))
        object.__setattr__(self, "faces", frozen(faces))
        if self.normals is not None:
            normals = rows_of_three(self.normals, np.float64, f"{where}: normals")
            if len(normals) != len(vertices):
                raise InputError(
                    f"{where} has {len(normals)} normals for {len(vertices)} vertices; one each is needed."
                )
            object.__setattr__(self, "normals", frozen(normals))

    def at_corners(self, name: str) -> FloatArray | None:
        """(F, 3, k) float64 values of an attribute at the corners of each face; None where there is none.

        Raises InputError where they cannot be read, or do not belong to this mesh.
        """
        if name not in self.attributes:
            return None
        found = self.attributes[name]
        given, needed = (
            (len(found.values), len(self.vertices))
            if found.corners is None
            else (len(found.corners), len(self.faces))
        )
        if given != needed:
            raise InputError(f"mesh {self.name!r}: {name} is for {given} elements, not {needed}.")
        return found.values[self.faces if found.corners is None else found.corners]


@dataclass(frozen=True, eq=False, kw_only=True)
class Instance:
    """A mesh that stands somewhere.

    mesh : index into the scene's meshes
    transform : (4, 4) float64, from the mesh's space to the scene's, for column vectors
    stored_with : the instance, this one or an earlier one, with which it shares its place in the file, so
        that both can only be given the same values (EXT_mesh_gpu_instancing); None: it has its own
    extras : what applications have noted there, by their keys
    """

    mesh: int
    transform: FloatArray = field(default_factory=lambda: np.eye(4))
    name: str = ""
    stored_with: int | None = None
    extras: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", placement(self.transform, "instance", self.name))


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that occludes, and everything that is baked.

    meshes, instances, materials : see there; values are baked per instance, in the order of instances
    images : what textures refer to
    cameras, lights : those of the file, where they stand; a bake needs neither
    motion : what of it can move, and how it stands
    source : the document that the scene was read from; None for a scene made from arrays
    warnings : what the reader passed over or had to mend, one line each
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    cameras: tuple[Camera, ...] = ()
    lights: tuple[Light, ...] = ()
    motion: Motion = field(default_factory=Motion)
    source: Source | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for number, instance in enumerate(self.instances):
            if not 0 <= instance.mesh < len(self.meshes):
                raise InputError(
                    f"instance {number} stands for mesh {instance.mesh}; there are {len(self.meshes)}."
                )
        for mesh in self.meshes:
            if mesh.material is not None and not 0 <= mesh.material < len(self.materials):
                raise InputError(
                    f"mesh {mesh.name!r} is made of material {mesh.material}; there are {len(self.materials)}."
                )

    @classmethod
    def from_arrays(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: ArrayLike | None = None,
        name: str | None = None,
    ) -> Scene:
        """A scene of one mesh.

        vertices : (V, 3) float
        faces : (F, 3) int, counter-clockwise as seen from the front
        normals : (V, 3) float, of any length; None: computed from the faces
        Empty arrays give a scene that bakes to empty results. Raises InputError for other shapes, and
        for faces that point at vertices which do not exist.
        """
        return cls.from_meshes([_mesh(vertices, faces, normals, name or "")])

    @classmethod
    def from_meshes(
        cls, meshes: Sequence[Mesh], source: Source | None = None, warnings: Sequence[str] = ()
    ) -> Scene:
        """A scene in which each mesh stands once, where its own coordinates put it."""
        placed = tuple(Instance(mesh=number, name=mesh.name) for number, mesh in enumerate(meshes))
        return cls(meshes=tuple(meshes), instances=placed, source=source, warnings=tuple(warnings))

    @classmethod
    def from_trimesh(cls, mesh: trimesh.Trimesh | trimesh.Scene) -> Scene:
        """A scene from a trimesh.Trimesh or a trimesh.Scene, whose geometries may be placed several times.

        Normals are taken where the trimesh object was given some, and computed else; texture coordinates,
        colours and materials as far as a preview needs them. Paths and point clouds are passed over.
        Raises InputError for any other object.
        """
        from aobake.meshes.trimeshes import scene_of

        return scene_of(mesh)

    def placed(self) -> Iterator[tuple[Instance, Mesh]]:
        """Every instance with its mesh, in order."""
        for instance in self.instances:
            yield instance, self.meshes[instance.mesh]

    @property
    def triangles(self) -> int:
        """Triangles of the whole scene, instances counted each."""
        return sum(len(mesh.faces) for _, mesh in self.placed())

    @property
    def vertices(self) -> int:
        """Vertices of the whole scene, instances counted each."""
        return sum(len(mesh.vertices) for _, mesh in self.placed())


def _mesh(vertices: ArrayLike, faces: ArrayLike, normals: ArrayLike | None, name: str) -> Mesh:
    where = f"mesh {name!r}" if name else "mesh"
    return Mesh(
        vertices=array_of(vertices, f"{where}: vertices"),
        faces=array_of(faces, f"{where}: faces"),
        normals=None if normals is None else array_of(normals, f"{where}: normals"),
        name=name,
    )

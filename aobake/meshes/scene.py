"""A scene: meshes, where they stand, what they are made of, and the document they came from.

Arrays are made read-only; a scene never changes once it is built.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError

if TYPE_CHECKING:
    import trimesh

__all__ = ["AlphaMode", "FloatArray", "Instance", "IntArray", "Material", "Mesh", "Scene", "Source"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int32]
ScalarT = TypeVar("ScalarT", bound=np.generic)
AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]

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
class Material:
    """What a mesh is made of, as far as occlusion and a preview need it."""

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)  # linear
    metallic: float = 0.0
    roughness: float = 1.0
    double_sided: bool = False
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh:
    """Triangles in their own space.

    vertices : (V, 3) float64, any value; vertices that are not finite are passed over and reported
    faces : (F, 3) int32, counter-clockwise as seen from their front
    normals : (V, 3) float64 of any length, or None where the file gives none
    flat_shaded : whether a mesh without normals is meant to show facets (glTF), so that coincident
        vertices of different faces keep normals of their own; else they are smoothed up to an angle
    material : index into the scene's materials, or None
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None = None
    name: str = ""
    flat_shaded: bool = False
    material: int | None = None

    def __post_init__(self) -> None:
        where = f"mesh {self.name!r}" if self.name else "mesh"
        vertices = _rows(self.vertices, np.float64, f"{where}: vertices")
        if len(vertices) > MOST_VERTICES:
            raise InputError(
                f"{where} has {len(vertices)} vertices; at most {MOST_VERTICES} can be baked."
            )
        faces = _faces(self.faces, len(vertices), where)
        object.__setattr__(self, "vertices", _frozen(vertices))
        object.__setattr__(self, "faces", _frozen(faces))
        if self.normals is not None:
            normals = _rows(self.normals, np.float64, f"{where}: normals")
            if len(normals) != len(vertices):
                raise InputError(
                    f"{where} has {len(normals)} normals for {len(vertices)} vertices; one each is needed."
                )
            object.__setattr__(self, "normals", _frozen(normals))


@dataclass(frozen=True, eq=False, kw_only=True)
class Instance:
    """A mesh that stands somewhere.

    mesh : index into the scene's meshes
    transform : (4, 4) float64, from the mesh's space to the scene's, for column vectors
    """

    mesh: int
    transform: FloatArray = field(default_factory=lambda: np.eye(4))
    name: str = ""

    def __post_init__(self) -> None:
        transform = np.array(self.transform, np.float64)
        if transform.shape != (4, 4):
            raise InputError(
                f"instance {self.name!r}: a transform is (4, 4), not {transform.shape}."
            )
        object.__setattr__(self, "transform", _frozen(transform))


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that occludes, and everything that is baked.

    meshes, instances, materials : see there; values are baked per instance, in the order of instances
    source : the document that the scene was read from; None for a scene made from arrays
    warnings : what the reader passed over or had to mend, one line each
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...] = ()
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

        Normals are taken where the trimesh object was given some, and computed else. Paths and point
        clouds are passed over. Raises InputError for any other object.
        """
        if hasattr(mesh, "faces") and hasattr(mesh, "vertices"):
            title = str(mesh.metadata.get("name") or "")
            return cls.from_meshes([_from_trimesh(cast("trimesh.Trimesh", mesh), title)])
        if not (hasattr(mesh, "geometry") and hasattr(mesh, "graph")):
            raise InputError(
                f"a {type(mesh).__name__} is no trimesh.Trimesh or trimesh.Scene. "
                "Use Scene.from_arrays(vertices, faces) for arrays."
            )
        names = [name for name, part in mesh.geometry.items() if hasattr(part, "faces")]
        number = {name: index for index, name in enumerate(names)}
        instances = []
        for node in mesh.graph.nodes_geometry:
            transform, name = mesh.graph[node]
            if name in number:
                instances.append(Instance(mesh=number[name], transform=transform, name=str(node)))
        meshes = tuple(_from_trimesh(mesh.geometry[name], str(name)) for name in names)
        return cls(meshes=meshes, instances=tuple(instances))

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
        vertices=_array(vertices, f"{where}: vertices"),
        faces=_array(faces, f"{where}: faces"),
        normals=None if normals is None else _array(normals, f"{where}: normals"),
        name=name,
    )


def _array(values: ArrayLike, what: str) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:  # rows of different lengths
        raise InputError(f"{what} are no array of numbers ({error}).") from error


def _from_trimesh(mesh: trimesh.Trimesh, name: str) -> Mesh:
    # vertex_normals would compute them, and merge what is sharp; the cache has them only if they were given.
    normals = mesh._cache.cache.get("vertex_normals")  # noqa: SLF001 - there is no public way
    return _mesh(mesh.vertices, mesh.faces, normals, name)


def _rows(values: ArrayLike, dtype: type[ScalarT], what: str) -> NDArray[ScalarT]:
    """(N, 3) C-ordered copy or view; InputError for any other shape or kind."""
    try:
        array: NDArray[ScalarT] = np.ascontiguousarray(values, dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} are no array of numbers ({error}).") from error
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{what} have the shape {array.shape}; (N, 3) is needed.")
    return array


def _faces(values: ArrayLike, vertices: int, where: str) -> IntArray:
    given = np.asarray(values)
    if given.size and given.dtype.kind not in "iu":
        raise InputError(f"{where}: faces are {given.dtype}; whole numbers are needed.")
    if given.size and not (int(given.min()) >= 0 and int(given.max()) < vertices):
        flat = given.reshape(-1)
        bad = int(np.argmax((flat < 0) | (flat >= vertices)))
        raise InputError(
            f"{where}: face {bad // 3} points at vertex {int(flat[bad])}; there are {vertices} vertices."
        )
    return _rows(given, np.int32, f"{where}: faces")


def _frozen(array: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A read-only view; the caller's own array stays as writable as it was."""
    view = array.view()
    view.flags.writeable = False
    return view

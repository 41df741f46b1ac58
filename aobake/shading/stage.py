"""What stands before the camera: every instance in one tree, its corners and normals at hand.

The tree of a bake is not used: it cuts and joins triangles, and a picture has to know which triangle of
which mesh it sees. Coordinates are those of a unit frame around what the camera looks at, so that
float32 is finest there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.normals import CREASE_DEGREES, unit_rows
from aobake.meshes.scene import Mesh, Scene
from aobake.meshes.surface import surface_of
from aobake.shading.camera import sample_places
from aobake.tracing import embree
from aobake.tracing.conditioning import UnitFrame

__all__ = ["Stage", "some_points", "stage_of"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

MOST_PER_FACE = 256  # points that stand for a face where there are few
SPARE_ROWS = -(-embree.READ_AHEAD_BYTES // embree.VERTEX_BYTES)
FLAT = (
    1e-6  # determinant, against the largest entry, of a transform that Embree can not invert well
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage:
    """Meshes and instances as the camera meets them.

    frame : from the scene's space to the tree's
    vertices, normals : (sum of V, 3) float32, of all bodies, in their own space; a body is a mesh that
        stands in one place, in the space of the tree, or one that is instanced
    faces : (sum of F, 3) int32, rows of these
    first_face : (things,) where the faces of each thing's body begin; a thing is what Embree numbers
    instance : (things,) the instance of the scene that each thing is
    columns, shift : (things, 3, 3) and (things, 3) float32, from the body's space to the tree's: the three
        columns of a linear map, and what is added
    fixed : how many things, the first ones, stand in the space of the tree
    sharp : (things,) float32, corners show the facet itself where the cosine between it and the vertex's
        normal is below this
    """

    tree: embree.Tree
    frame: UnitFrame
    vertices: Float32Array
    normals: Float32Array
    faces: NDArray[np.int32]
    first_face: NDArray[np.int64]
    instance: NDArray[np.int64]
    columns: Float32Array
    shift: Float32Array
    fixed: int
    sharp: Float32Array


@dataclass(frozen=True, eq=False)
class _Body:
    """A mesh in the space that Embree gets it in; what is not finite is dropped by Embree itself."""

    vertices: FloatArray
    normals: FloatArray
    faces: NDArray[np.int32]


def stage_of(scene: Scene, frame: UnitFrame) -> Stage:
    """Put every instance on the stage. An instance whose transform is not finite is left out.

    frame : of the tree
    """
    normals = [_normals(mesh) for mesh in scene.meshes]
    shown = [n for n, i in enumerate(scene.instances) if np.isfinite(i.transform).all()]
    uses = np.bincount(
        np.array([scene.instances[n].mesh for n in shown], np.int64), minlength=len(scene.meshes)
    )
    moving = [
        n
        for n in shown
        if uses[scene.instances[n].mesh] > 1 and _invertible(scene.instances[n].transform)
    ]
    fixed = sorted(set(shown) - set(moving))
    kept = sorted({scene.instances[n].mesh for n in moving})
    bodies = [_in_place(scene, n, normals, frame) for n in fixed]
    own = [_unit(scene.meshes[mesh].vertices) for mesh in kept]
    for mesh, space in zip(kept, own, strict=True):
        placed = scene.meshes[mesh]
        bodies.append(_Body(space.apply(placed.vertices), normals[mesh], placed.faces))
    linear, shift = _transforms(scene, moving, kept, own, frame)
    body = [
        *range(len(fixed)),
        *(len(fixed) + kept.index(scene.instances[n].mesh) for n in moving),
    ]
    shown = [*fixed, *moving]
    sharp = [_sharp(scene.meshes[scene.instances[n].mesh]) for n in shown]
    return _stage(bodies, body, (shown, sharp), (linear, shift), frame)


def some_points(stage: Stage, most: int) -> tuple[Float32Array, Float32Array]:
    """(3, N) positions and unit normals on all things, spread over their faces, in the space of the tree.

    most : N, roughly; large faces get no more than small ones
    """
    faces_of = np.diff(np.append(np.unique(stage.first_face), len(stage.faces)))
    faces_of = faces_of[np.searchsorted(np.unique(stage.first_face), stage.first_face)]
    step = -(-int(faces_of.sum()) // most)
    places = sample_places(min(MOST_PER_FACE, max(1, most // max(1, int(faces_of.sum())))))
    root = np.sqrt(places[:, 0])
    weights = np.stack([1.0 - root, root * (1.0 - places[:, 1]), root * places[:, 1]])
    positions, normals = [], []
    for thing, (first, count) in enumerate(zip(stage.first_face, faces_of, strict=True)):
        rows = stage.faces[first : first + count : step]
        linear = stage.columns[thing].T.astype(np.float64)
        at = np.einsum("kp,fkc->fpc", weights, stage.vertices[rows]).reshape(-1, 3)
        normal = np.einsum("kp,fkc->fpc", weights, stage.normals[rows]).reshape(-1, 3)
        positions.append(at @ linear.T + stage.shift[thing])
        normals.append(unit_rows(normal @ _cofactors(linear).T))
    found, turned = np.concatenate(positions).T, np.concatenate(normals).T
    finite = np.isfinite(found).all(axis=0)
    return found[:, finite].astype(np.float32), turned[:, finite].astype(np.float32)


def _stage(
    bodies: Sequence[_Body],
    body: Sequence[int],
    things: tuple[Sequence[int], Sequence[float]],
    transforms: tuple[FloatArray, FloatArray],
    frame: UnitFrame,
) -> Stage:
    """Pool the bodies, and build the tree over them.

    body : of each thing, those that stand where they are first; things : their instances and `sharp`
    """
    instance, sharp = things
    first_vertex = np.cumsum([0, *(len(b.vertices) for b in bodies)])
    first_face = np.cumsum([0, *(len(b.faces) for b in bodies)])
    vertices = np.zeros((first_vertex[-1] + SPARE_ROWS, 3), np.float32)
    normals = np.zeros((first_vertex[-1], 3), np.float32)
    faces, own_faces = np.zeros((first_face[-1], 3), np.int32), []
    for k, b in enumerate(bodies):
        with np.errstate(over="ignore"):  # vertices that no face uses may lie anywhere
            vertices[first_vertex[k] : first_vertex[k + 1]] = b.vertices
        normals[first_vertex[k] : first_vertex[k + 1]] = b.normals
        faces[first_face[k] : first_face[k + 1]] = b.faces + np.int32(first_vertex[k])
        own_faces.append(np.ascontiguousarray(b.faces).view(np.uint32))
    geometry = [
        embree.Body(vertices[first_vertex[k] : first_vertex[k + 1]], own_faces[k])
        for k in range(len(bodies))
    ]
    linear, shift = transforms
    fixed = len(instance) - len(linear)
    matrices = np.concatenate([linear, shift[:, :, None]], axis=2).astype(np.float32)
    placed = [(k - fixed, matrix) for k, matrix in zip(body[fixed:], matrices, strict=True)]
    eye = np.broadcast_to(np.eye(3), (fixed, 3, 3))
    return Stage(
        tree=embree.build_tree(geometry[:fixed], geometry[fixed:], placed),
        frame=frame,
        vertices=vertices,
        normals=normals,
        faces=faces,
        first_face=first_face[np.array(body, np.int64)],
        instance=np.array(instance, np.int64),
        columns=np.ascontiguousarray(np.concatenate([eye, linear]).swapaxes(1, 2), np.float32),
        shift=np.concatenate([np.zeros((fixed, 3)), shift]).astype(np.float32),
        fixed=fixed,
        sharp=np.array(sharp, np.float32),
    )


def _normals(mesh: Mesh) -> FloatArray:
    """(V, 3) unit normals; zeros where facets are shown."""
    if mesh.normals is not None:
        return unit_rows(mesh.normals)
    return np.zeros_like(mesh.vertices) if mesh.flat_shaded else surface_of(mesh).normals


def _sharp(mesh: Mesh) -> float:
    """Given normals are believed; without, a mesh shows facets, or is smooth up to an angle."""
    if mesh.normals is not None:
        return -2.0
    return 2.0 if mesh.flat_shaded else math.cos(math.radians(CREASE_DEGREES))


def _invertible(transform: FloatArray) -> bool:
    linear = transform[:3, :3]
    size = float(np.abs(linear).max())
    return size > 0.0 and abs(float(np.linalg.det(linear / size))) > FLAT


def _in_place(scene: Scene, number: int, normals: Sequence[FloatArray], frame: UnitFrame) -> _Body:
    """An instance in the space of the tree."""
    instance = scene.instances[number]
    mesh, own = scene.meshes[instance.mesh], normals[instance.mesh]
    if np.array_equal(instance.transform, np.eye(4)):
        return _Body(frame.apply(mesh.vertices), own, mesh.faces)
    linear, shift = instance.transform[:3, :3], instance.transform[:3, 3]
    turned = unit_rows(own @ _cofactors(linear).T)
    return _Body(frame.apply(mesh.vertices @ linear.T + shift), turned, mesh.faces)


def _unit(vertices: FloatArray) -> UnitFrame:
    """A frame around the finite vertices of a mesh."""
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    if len(finite) == 0:
        return UnitFrame(np.zeros(3), 1.0)
    low, high = finite.min(axis=0), finite.max(axis=0)
    size = float((high - low).max())
    return UnitFrame((low + high) / 2.0, 1.0 / size if size > 0.0 else 1.0)


def _transforms(
    scene: Scene,
    moving: Sequence[int],
    kept: Sequence[int],
    own: Sequence[UnitFrame],
    frame: UnitFrame,
) -> tuple[FloatArray, FloatArray]:
    """From the unit space of each moving instance's mesh to the tree's."""
    linear, shift = np.empty((len(moving), 3, 3)), np.empty((len(moving), 3))
    for k, number in enumerate(moving):
        transform = scene.instances[number].transform
        space = own[kept.index(scene.instances[number].mesh)]
        linear[k] = transform[:3, :3] * (frame.scale / space.scale)
        at = transform[:3, :3] @ space.center + transform[:3, 3]
        shift[k] = (at - frame.center) * frame.scale
    return linear, shift


def _cofactors(linear: FloatArray) -> FloatArray:
    """(3, 3) what turns normals when `linear` moves points; also where it flattens or mirrors."""
    size = float(np.abs(linear).max()) or 1.0
    a, b, c = (linear / size).T
    found = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return found if np.linalg.det(linear / size) >= 0.0 else -found

"""Skins in their rest pose: where the joints of the node tree put the vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.geometry import PrimitiveReader
from aobake.meshes.formats.gltf.nodes import NodeTree

__all__ = ["joint_matrices", "skin_matrices", "skinned", "skinned_normals"]

FloatArray = NDArray[np.float64]
BLOCK = 1 << 16  # vertices at a time: 16 numbers each


def joint_matrices(reader: AccessorReader, tree: NodeTree, number: int) -> FloatArray:
    """(J, 4, 4) from the mesh's bind space to the scene, one per joint of a skin. Raises InputError."""
    skin = reader.document.entry("skins", number)
    joints = skin.indices("joints", reader.document.size("nodes"), "nodes")
    if not joints:
        raise InputError(f"{skin.where} has no joints; one at least is needed. Export it again.")
    world = tree.world[joints]
    inverse = skin.maybe_index(
        "inverseBindMatrices", reader.document.size("accessors"), "accessors"
    )
    if inverse is None:
        return world
    bind = reader.floats(inverse, ("MAT4",))
    if len(bind) < len(joints):
        raise InputError(
            f"{skin.where} has {len(joints)} joints and {len(bind)} inverse bind matrices; "
            "one each is needed. Export it again."
        )
    with np.errstate(over="ignore", invalid="ignore"):
        return world @ bind[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)


def skin_matrices(
    primitives: PrimitiveReader, primitive: Element, vertices: int, joints: FloatArray
) -> FloatArray | None:
    """(V, 3, 4) of every vertex, its joints blended; None where it has no JOINTS_0 and WEIGHTS_0.

    Weights are normalised to a sum of one; a vertex without any follows its first joint, as in the
    stock viewers. Raises InputError where a vertex follows a joint that the skin does not have.
    """
    attributes, where = primitive.needed("attributes"), primitive.where
    numbers, weights = [], []
    for level in range(len(attributes.value)):
        if f"JOINTS_{level}" not in attributes or f"WEIGHTS_{level}" not in attributes:
            break
        numbers.append(primitives.stored(primitive, f"JOINTS_{level}", ("VEC4",)))
        weights.append(primitives.floats(primitive, f"WEIGHTS_{level}", ("VEC4",)))
    if not numbers:
        return None
    if any(len(column) != vertices for column in (*numbers, *weights)):
        raise InputError(f"{where}: its joints or weights are not {vertices}, one for each vertex.")
    primitives.reader.spend(vertices * 12 * 8, where)
    joint, weight = _clean(
        np.concatenate(numbers, axis=1), np.concatenate(weights, axis=1), len(joints), where
    )
    blended = np.empty((vertices, 3, 4))
    rows = joints[:, :3, :]
    for start in range(0, vertices, BLOCK):
        part = slice(start, start + BLOCK)
        blended[part] = np.einsum("vk,vkij->vij", weight[part], rows[joint[part]])
    return blended


def _clean(
    joint: NDArray[np.generic], weight: FloatArray, count: int, where: str
) -> tuple[NDArray[np.int64], FloatArray]:
    if joint.dtype.kind != "u":
        raise InputError(
            f"{where}: its joints are {joint.dtype}; unsigned whole numbers are needed."
        )
    number = joint.astype(np.int64)
    weight = np.where(np.isfinite(weight), weight, 0.0)
    used = weight != 0.0
    if np.any(used & (number >= count)):
        worst = int(number[used].max())
        raise InputError(f"{where}: a vertex follows joint {worst}, and the skin has {count}.")
    number = np.where(number < count, number, 0)
    total = weight.sum(axis=1, keepdims=True)
    weight = np.where(total != 0.0, weight / np.where(total != 0.0, total, 1.0), 0.0)
    weight[total[:, 0] == 0.0, 0] = 1.0
    return number, weight


def skinned(vertices: FloatArray, matrices: FloatArray) -> FloatArray:
    """(V, 3) vertices where their (V, 3, 4) matrices put them."""
    with np.errstate(over="ignore", invalid="ignore"):
        turned: FloatArray = np.einsum("vij,vj->vi", matrices[:, :, :3], vertices)
        return turned + matrices[:, :, 3]


def skinned_normals(normals: FloatArray, matrices: FloatArray) -> tuple[FloatArray, bool]:
    """(V, 3) normals turned by the inverse transpose of their matrices, and whether most are mirrored.

    The cofactor matrix is the inverse transpose times the determinant: it needs no division, so that
    a joint of zero scale gives a zero normal and no error.
    """
    a, b, c = (matrices[:, :, k] for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        columns = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        determinant = np.einsum("vi,vi->v", a, columns[:, :, 0])
        turned = np.einsum("vij,vj->vi", columns, normals) * np.sign(determinant)[:, None]
    mirrored = bool(len(determinant)) and float(np.mean(determinant < 0.0)) > 0.5
    return turned, mirrored

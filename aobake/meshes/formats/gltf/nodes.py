"""The node tree: who stands where, and which nodes a scene shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element

__all__ = ["INSTANCING", "NodeTree", "chosen_scene", "gpu_instances", "node_tree", "shown_nodes"]

INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"
MOST_INSTANCES = 1_000_000  # about a kilobyte each


@dataclass(frozen=True, eq=False)
class NodeTree:
    """Every node of a document.

    children : numbers of the nodes below each
    roots : nodes that stand below none
    world : (N, 4, 4) float64, from each node's space to the scene's
    """

    children: list[list[int]]
    roots: list[int]
    world: NDArray[np.float64]


def node_tree(nodes: Sequence[Element]) -> NodeTree:
    """The nodes of a document with their places. Raises InputError where they are no tree."""
    count = len(nodes)
    children = [node.indices("children", count, "nodes") for node in nodes]
    parents = _parents(children, nodes)
    roots = [number for number in range(count) if parents[number] is None]
    world = np.zeros((count, 4, 4))
    waiting = list(roots)
    seen = 0
    with np.errstate(over="ignore", invalid="ignore"):
        while waiting:
            number = waiting.pop()
            seen += 1
            above = parents[number]
            local = _local(nodes[number])
            world[number] = local if above is None else world[above] @ local
            waiting += children[number]
    if seen < count:
        _refuse_cycle(parents, nodes)
    return NodeTree(children, roots, world)


def _parents(children: list[list[int]], nodes: Sequence[Element]) -> list[int | None]:
    parents: list[int | None] = [None] * len(nodes)
    for number, below in enumerate(children):
        for child in below:
            if parents[child] is not None:
                raise InputError(
                    f"{nodes[child].where} has two parents, nodes {parents[child]} and {number}; "
                    "a node stands in one place. Export it again."
                )
            parents[child] = number
    return parents


def _refuse_cycle(parents: list[int | None], nodes: Sequence[Element]) -> None:
    """Raise InputError naming a node that stands below itself."""
    settled: set[int] = set()
    for start in range(len(nodes)):
        path: list[int] = []
        seen: set[int] = set()
        number: int | None = start
        while number is not None and number not in settled:
            if number in seen:
                raise InputError(
                    f"{nodes[number].where} stands below itself: its children lead back to it. "
                    "Export it again."
                )
            seen.add(number)
            path.append(number)
            number = parents[number]
        settled.update(path)


def _local(node: Element) -> NDArray[np.float64]:
    """(4, 4) from a node's space to its parent's."""
    if "matrix" in node:
        by_columns = np.array(node.numbers("matrix", (0.0,) * 16), np.float64)
        return by_columns.reshape(4, 4).T
    translation = np.array(node.numbers("translation", (0.0, 0.0, 0.0)))
    rotation = np.array(node.numbers("rotation", (0.0, 0.0, 0.0, 1.0)))
    scale = np.array(node.numbers("scale", (1.0, 1.0, 1.0)))
    return _compose(translation[None], rotation[None], scale[None]).reshape(4, 4)


def _compose(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 4, 4) = T R S; a quaternion (x, y, z, w) of any length stands for its direction."""
    length = np.linalg.norm(rotation, axis=1, keepdims=True)
    unit = np.where(
        length > 0.0, rotation / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 0.0, 1.0)
    )
    x, y, z, w = unit.T
    matrix = np.zeros((len(unit), 4, 4))
    matrix[:, 0, :3] = np.stack(
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1
    )
    matrix[:, 1, :3] = np.stack(
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1
    )
    matrix[:, 2, :3] = np.stack(
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1
    )
    matrix[:, :3, :3] *= scale[:, None, :]
    matrix[:, :3, 3] = translation
    matrix[:, 3, 3] = 1.0
    return matrix


def gpu_instances(reader: AccessorReader, node: Element) -> NDArray[np.float64] | None:
    """(N, 4, 4) of EXT_mesh_gpu_instancing, in the node's space; None for a node without it."""
    extension = node.extension(INSTANCING)
    if extension is None:
        return None
    attributes = extension.needed("attributes")
    parts: dict[str, NDArray[np.float64]] = {}
    for name, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")):
        if name in attributes:
            number = attributes.index(name, reader.document.size("accessors"), "accessors")
            parts[name] = reader.floats(number, (kind,))
    sizes = {len(values) for values in parts.values()}
    if len(sizes) != 1:
        raise InputError(
            f"{extension.where}: its attributes have {sorted(sizes) or 'no'} values; "
            "one number of instances is needed. Export it again."
        )
    count = sizes.pop()
    if count > MOST_INSTANCES:
        raise InputError(
            f"{extension.where}: {count} instances; at most {MOST_INSTANCES} can be baked."
        )
    nothing = np.zeros((count, 3))
    unit = np.broadcast_to(np.array((0.0, 0.0, 0.0, 1.0)), (count, 4))
    return _compose(
        parts.get("TRANSLATION", nothing),
        parts.get("ROTATION", unit),
        parts.get("SCALE", nothing + 1.0),
    )


def chosen_scene(document: Document, scene: str | None) -> int | None:
    """The number of a scene by name or number; the default one for None; None where there are no scenes."""
    if scene is None:
        count = document.size("scenes")
        if not count:
            return None
        default = document.top.maybe_index("scene", count, "scenes")
        return 0 if default is None else default
    return document.find("scenes", scene)


def shown_nodes(document: Document, tree: NodeTree, scene: int | None) -> list[int]:
    """Nodes of a scene, each once, parents before their children and in the order of the file.

    Those that KHR_node_visibility hides are left out, with everything below them.
    """
    if scene is None:
        first = list(tree.roots)
    else:
        first = document.entry("scenes", scene).indices("nodes", document.size("nodes"), "nodes")
    found: dict[int, None] = {}
    waiting = first[::-1]
    while waiting:
        number = waiting.pop()
        if number not in found and not _is_hidden(document.entry("nodes", number)):
            found[number] = None
            waiting += tree.children[number][::-1]
    return list(found)


def _is_hidden(node: Element) -> bool:
    extension = node.extension(VISIBILITY)
    return extension is not None and "visible" in extension and not extension.flag("visible")

"""A new glTF document for a scene that was not read from one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count, takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.container import Container, padding
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.jsontext import JsonObject, JsonText
from aobake.meshes.formats.gltf.source import Binding, GltfSource
from aobake.meshes.scene import Instance, Material, Mesh, Scene

__all__ = ["fresh_source", "in_stored_space"]

FloatArray = NDArray[np.float64]
BIN = 0x004E4942
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def fresh_source(scene: Scene, target: Path) -> GltfSource:
    """The scene as a glTF document in memory, ready to be given its occlusion.

    Positions become float32, about a centre of their own where they lie far from the origin. Meshes that
    stand in several places are stored once; one whose transform is no translation, rotation and scale
    is stored where it stands. Vertices that are not finite stay, at the origin, without their triangles.
    """
    builder = _Builder(scene)
    nodes, bindings = [], []
    for number, instance in enumerate(scene.instances):
        node, mesh = builder.node(instance)
        nodes.append(node)
        bindings.append(Binding(number, mesh, 0))
    json: JsonObject = {"asset": {"version": "2.0", "generator": "aobake"}}
    if nodes:
        json |= {"scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes}
        json |= {
            "meshes": builder.meshes,
            "accessors": builder.accessors,
            "bufferViews": builder.views,
        }
        json["buffers"] = [{"byteLength": len(builder.data)}]
    if scene.materials:
        json["materials"] = [_material(material) for material in scene.materials]
    chunks = ((BIN, memoryview(bytes(builder.data))),) if nodes else ()
    container = Container(is_glb=True, text=b"", chunks=chunks)
    document = Document(target, None, container, json, JsonText(b""))
    return GltfSource(document, tuple(bindings), 0 if nodes else None)


def in_stored_space(
    scene: Scene, directions: Sequence[NDArray[np.float32]]
) -> list[NDArray[np.float32]]:
    """Directions in the spaces of a scene's meshes, in those that the file has for them.

    directions : (V_i, 3) of each instance, turned like normals
    """
    if isinstance(scene.source, GltfSource):
        return list(directions)
    return [
        own
        if _is_trs(instance.transform)
        else _unit(own @ np.linalg.pinv(instance.transform[:3, :3])).astype(np.float32)
        for instance, own in zip(scene.instances, directions, strict=True)
    ]


class _Builder:
    """Meshes, accessors and bytes gathered so far."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.meshes: list[JsonObject] = []
        self.accessors: list[JsonObject] = []
        self.views: list[JsonObject] = []
        self.data = bytearray()
        self._known: dict[int, tuple[int, FloatArray]] = {}

    def node(self, instance: Instance) -> tuple[JsonObject, int]:
        """The node of an instance, and the number of its mesh."""
        mesh = self.scene.meshes[instance.mesh]
        node: JsonObject = {"name": instance.name} if instance.name else {}
        if _is_trs(instance.transform):
            if instance.mesh not in self._known:
                self._known[instance.mesh] = self._mesh(mesh, np.eye(4))
            number, centre = self._known[instance.mesh]
            matrix = instance.transform @ _moved(centre)
        else:
            number, centre = self._mesh(mesh, instance.transform)
            matrix = _moved(centre)
        node["mesh"] = number
        if not np.array_equal(matrix, np.eye(4)):
            node["matrix"] = [float(value) for value in matrix.T.reshape(-1)]
        return node, number

    def _mesh(self, mesh: Mesh, transform: FloatArray) -> tuple[int, FloatArray]:
        """A mesh with its vertices under the transform and about a centre: its number, the centre."""
        with np.errstate(all="ignore"):
            vertices = mesh.vertices @ transform[:3, :3].T + transform[:3, 3]
            normals = (
                None if mesh.normals is None else mesh.normals @ np.linalg.pinv(transform[:3, :3])
            )
        finite = np.logical_and.reduce(np.isfinite(vertices), axis=1)
        faces = mesh.faces[np.logical_and.reduce(finite[mesh.faces], axis=1)]
        centre = _centre(vertices[finite])
        positions = np.where(finite[:, None], vertices - centre, 0.0).astype(np.float32)
        attributes: JsonObject = {"POSITION": self._column(positions, bounds=True)}
        if normals is not None and len(normals):
            attributes["NORMAL"] = self._column(_unit(normals).astype(np.float32))
        for name, values in _of_vertices(mesh):
            attributes[name] = self._column(values)
        primitive: JsonObject = {
            "attributes": attributes,
            "indices": self._indices(faces, len(vertices)),
        }
        if mesh.material is not None:
            primitive["material"] = mesh.material
        entry: JsonObject = {"name": mesh.name} if mesh.name else {}
        self.meshes.append({**entry, "primitives": [primitive]})
        return len(self.meshes) - 1, centre

    def _column(self, values: NDArray[np.float32], *, bounds: bool = False) -> int:
        accessor: JsonObject = {"bufferView": self._view(values.tobytes(), ARRAY_BUFFER)}
        accessor |= {"componentType": 5126, "count": len(values)}
        accessor["type"] = f"VEC{values.shape[1]}"
        if bounds:
            accessor["min"] = [float(value) for value in values.min(axis=0)]
            accessor["max"] = [float(value) for value in values.max(axis=0)]
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def _indices(self, faces: NDArray[np.int32], vertices: int) -> int:
        small = vertices <= 65535  # 65535 itself restarts a primitive, and is no index
        flat = faces.astype(np.uint16 if small else np.uint32).reshape(-1)
        accessor: JsonObject = {"bufferView": self._view(flat.tobytes(), ELEMENT_ARRAY_BUFFER)}
        accessor |= {"componentType": 5123 if small else 5125, "count": len(flat), "type": "SCALAR"}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def _view(self, data: bytes, target: int) -> int:
        view: JsonObject = {
            "buffer": 0,
            "byteOffset": len(self.data),
            "byteLength": len(data),
            "target": target,
        }
        self.data += data + b"\0" * padding(len(data))
        self.views.append(view)
        return len(self.views) - 1


def _of_vertices(mesh: Mesh) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Colours and texture coordinates that belong to vertices, the latter numbered without a gap."""

    def kept(name: str) -> bool:
        found = mesh.attributes.get(name)
        return found is not None and found.corners is None and len(found.values) > 0

    sets = takewhile(kept, (f"TEXCOORD_{n}" for n in count()))
    for name in (*filter(kept, ["COLOR_0"]), *sets):
        yield name, np.nan_to_num(mesh.attributes[name].values).astype(np.float32)


def _centre(vertices: FloatArray) -> FloatArray:
    """What to subtract before float32: nothing where that rounds by less than a millionth of the size."""
    if not len(vertices):
        return np.zeros(3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = float(np.linalg.norm(high - low))
    farthest = float(np.abs(np.concatenate([low, high])).max())
    if farthest * np.finfo(np.float32).eps <= 1e-6 * size:
        return np.zeros(3)
    centre: FloatArray = (low + high) / 2
    return centre


def _moved(offset: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _is_trs(transform: FloatArray) -> bool:
    """Whether a node of glTF can hold it: its axes are orthogonal and none vanishes."""
    if not np.isfinite(transform).all() or not np.array_equal(transform[3], (0.0, 0.0, 0.0, 1.0)):
        return False
    axes = transform[:3, :3]
    length = np.linalg.norm(axes, axis=0)
    if not (length > 0.0).all():
        return False
    unit = axes / length
    return bool(np.allclose(unit.T @ unit, np.eye(3), atol=1e-6))


def _unit(normals: FloatArray) -> FloatArray:
    """Normals of length one; one without a direction points up, as a file cannot leave it out."""
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        good = np.isfinite(length) & (length > 0.0)
        return np.where(good, normals / np.where(good, length, 1.0), (0.0, 1.0, 0.0))


def _material(material: Material) -> JsonObject:
    found: JsonObject = {"name": material.name} if material.name else {}
    found["pbrMetallicRoughness"] = {
        "baseColorFactor": [float(value) for value in material.base_color],
        "metallicFactor": float(material.metallic),
        "roughnessFactor": float(material.roughness),
    }
    if material.double_sided:
        found["doubleSided"] = True
    if material.alpha_mode != "OPAQUE":
        found["alphaMode"] = material.alpha_mode
    if material.alpha_mode == "MASK":
        found["alphaCutoff"] = float(material.alpha_cutoff)
    return found

"""A glTF or GLB file as a scene: one mesh for each primitive, one instance wherever it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.animations import Pose, pose_of, posed_nodes
from aobake.meshes.formats.gltf.attributes import TANGENT, SurfaceReader
from aobake.meshes.formats.gltf.cameras import read_cameras, read_lights
from aobake.meshes.formats.gltf.document import Document, open_document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.extensions import check_required
from aobake.meshes.formats.gltf.geometry import (
    TRIANGLE_MODES,
    Geometry,
    PrimitiveReader,
    is_morphed,
)
from aobake.meshes.formats.gltf.materials import read_materials
from aobake.meshes.formats.gltf.motion import motion_of
from aobake.meshes.formats.gltf.nodes import (
    MOST_INSTANCES,
    NodeTree,
    chosen_scene,
    gpu_instances,
    node_tree,
    shown_nodes,
)
from aobake.meshes.formats.gltf.skins import joint_matrices, skin_matrices, skinned, skinned_normals
from aobake.meshes.formats.gltf.source import Binding, GltfSource
from aobake.meshes.formats.gltf.textures import read_images
from aobake.meshes.scene import Instance, Mesh, Scene

__all__ = ["read"]

FloatArray = NDArray[np.float64]


def read(path: Path, *, root: Path | None, scene: str | None, pose: str | None = None) -> Scene:
    """The scene in a glTF or GLB file.

    root : a folder whose files may be read as well; None: the asset's own folder alone
    scene : name or number of the glTF scene; None: the default one
    pose : CLIP@SECONDS, the moment of an animation that is taken; None: no animation is looked at
    Points and lines are passed over. Raises InputError, and SettingsError for what is no pose.
    """
    asked = None if pose is None else pose_of(pose)
    document = open_document(path, root)
    check_required(document)
    return _SceneBuilder(document, chosen_scene(document, scene), asked).build()


class _SceneBuilder:
    """Meshes and instances as they are found on the way through the node tree."""

    def __init__(self, document: Document, scene: int | None, pose: Pose | None) -> None:
        self.document = document
        self.scene = scene
        self.reader = AccessorReader(document)
        self.posed = None if pose is None else posed_nodes(self.reader, pose)
        moved = {} if self.posed is None else self.posed.nodes
        self.nodes = [moved.get(n, node) for n, node in enumerate(document.entries("nodes"))]
        self.primitives = PrimitiveReader(self.reader)
        self.surfaces = SurfaceReader(document)
        self.tree: NodeTree = node_tree(self.nodes)
        self.meshes: list[Mesh] = []
        self.instances: list[Instance] = []
        self.bindings: list[Binding] = []
        self._known: dict[tuple[object, ...], int] = {}
        self._joints: dict[int, FloatArray] = {}

    def build(self) -> Scene:
        shown = shown_nodes(self.document, self.tree, self.scene)
        for number in shown:
            node = self.nodes[number]
            mesh = node.maybe_index("mesh", self.document.size("meshes"), "meshes")
            if mesh is not None:
                self._node(number, node, mesh)
        materials, textures_said = read_materials(self.document)
        cameras, cameras_said = read_cameras(self.document, self.tree, shown)
        lights, lights_said = read_lights(self.document, self.tree, shown)
        posed = self.posed
        return Scene(
            meshes=tuple(self.meshes),
            instances=tuple(self.instances),
            materials=materials,
            images=read_images(self.document),
            cameras=cameras,
            lights=lights,
            source=GltfSource(self.document, tuple(self.bindings), self.scene),
            motion=motion_of(self.document, self.bindings, posed.label if posed else None),
            warnings=(
                *(posed.warnings if posed else ()),
                *textures_said,
                *cameras_said,
                *lights_said,
            ),
        )

    def _node(self, number: int, node: Element, mesh_number: int) -> None:
        mesh = self.document.entry("meshes", mesh_number)
        weights = (node if "weights" in node else mesh).numbers("weights")
        skin = node.maybe_index("skin", self.document.size("skins"), "skins")
        for primitive_number, primitive in enumerate(mesh.children("primitives", "primitive")):
            if primitive.integer("mode", 4) not in TRIANGLE_MODES:
                continue
            binding = Binding(number, mesh_number, primitive_number)
            if skin is None or not self._skinned(binding, node, primitive, weights, skin):
                self._rigid(binding, node, primitive, weights)

    def _rigid(
        self, binding: Binding, node: Element, primitive: Element, weights: tuple[float, ...]
    ) -> None:
        key = ("rigid", binding.mesh, binding.primitive, weights)
        if key not in self._known:
            shape = self.primitives.geometry(primitive, weights)
            # Flat facets have tangents of their own, and moved ones are computed anew.
            tangents = shape.normals is not None and not is_morphed(primitive, TANGENT, weights)
            self._known[key] = self._add_mesh(binding, primitive, shape, tangents=tangents)
        world = self.tree.world[binding.node]
        copies = gpu_instances(self.reader, node)
        if copies is None:
            self._place(binding, self._known[key], world, node)
            return
        first = len(self.instances)
        if first + len(copies) > MOST_INSTANCES:
            raise InputError(
                f"{node.where}: more than {MOST_INSTANCES} instances in the scene cannot be baked."
            )
        for gpu, local in enumerate(copies):
            at = Binding(binding.node, binding.mesh, binding.primitive, gpu)
            self._place(at, self._known[key], world @ local, node, stored_with=first)

    def _skinned(
        self,
        binding: Binding,
        node: Element,
        primitive: Element,
        weights: tuple[float, ...],
        skin: int,
    ) -> bool:
        """Place a primitive where its joints put it; False where it has no joints."""
        if skin not in self._joints:
            self._joints[skin] = joint_matrices(self.reader, self.tree, skin)
        shape = self.primitives.geometry(primitive, weights)
        matrices = skin_matrices(
            self.primitives, primitive, len(shape.vertices), self._joints[skin]
        )
        if matrices is None:
            return False
        self.reader.spend(len(shape.vertices) * 48, node.where)
        normals, faces = shape.normals, shape.faces
        if normals is not None:
            normals, mirrored = skinned_normals(normals, matrices)
            # Vertices that a mirroring joint has turned inside out keep their front in front.
            faces = faces[:, ::-1] if mirrored else faces
        posed = Geometry(skinned(shape.vertices, matrices), faces, normals)
        mesh = self._add_mesh(binding, primitive, posed, tangents=False)
        self._place(binding, mesh, np.eye(4), node)
        return True

    def _add_mesh(
        self, binding: Binding, primitive: Element, shape: Geometry, *, tangents: bool
    ) -> int:
        mesh = self.document.entry("meshes", binding.mesh)
        several = len(mesh.list_of("primitives")) > 1
        self.meshes.append(
            Mesh(
                vertices=shape.vertices,
                faces=shape.faces,
                normals=shape.normals,
                name=f"{mesh.name} ({binding.primitive})" if several else mesh.name,
                flat_shaded=shape.normals is None,
                material=primitive.maybe_index(
                    "material", self.document.size("materials"), "materials"
                ),
                attributes=self.surfaces.attributes(
                    primitive, len(shape.vertices), tangents=tangents
                ),
                extras={**mesh.extras, **primitive.extras},
            )
        )
        return len(self.meshes) - 1

    def _place(
        self,
        binding: Binding,
        mesh: int,
        transform: FloatArray,
        node: Element,
        stored_with: int | None = None,
    ) -> None:
        self.instances.append(
            Instance(
                mesh=mesh,
                transform=transform,
                name=node.name,
                stored_with=stored_with,
                extras=node.extras,
            )
        )
        self.bindings.append(binding)

"""The document that a scene was read from, and which part of it each instance of the scene stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aobake.meshes.formats.gltf.document import Document

__all__ = ["Binding", "GltfSource"]


@dataclass(frozen=True)
class Binding:
    """The part of a document that an instance of the scene stands for.

    gpu : the number of the instance under EXT_mesh_gpu_instancing; None without it
    """

    node: int
    mesh: int
    primitive: int
    gpu: int | None = None


@dataclass(frozen=True, eq=False)
class GltfSource:
    """A glTF document, and one binding for each instance of the scene, in its order.

    scene : the number of the glTF scene; None for a document without scenes
    """

    document: Document
    bindings: tuple[Binding, ...]
    scene: int | None

    @property
    def path(self) -> Path:
        """The file that was opened."""
        return self.document.path

    @property
    def format(self) -> str:
        """'GLB' or 'glTF'."""
        return "GLB" if self.document.container.is_glb else "glTF"

    @property
    def files(self) -> tuple[Path, ...]:
        """The file that was opened, then every file it refers to and that exists."""
        sides = self.document.side_files().values()
        return (self.path, *dict.fromkeys(side.path for side in sides))

    def facts(self) -> Mapping[str, object]:
        """What is in the document, for people; nothing is read from buffers for it."""
        from aobake.meshes.formats.gltf.facts import facts

        return facts(self)

"""Scenes from trimesh objects. Nothing of trimesh is imported: whoever gives one has it."""

from __future__ import annotations

import io
from functools import partial
from typing import TYPE_CHECKING, Protocol, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from aobake.errors import InputError
from aobake.meshes.scene import (
    AlphaMode,
    Attribute,
    FloatArray,
    Image,
    Instance,
    Material,
    Mesh,
    Scene,
    Texture,
)

if TYPE_CHECKING:
    import trimesh

__all__ = ["scene_of"]


class Picture(Protocol):
    """What is needed of a PIL image."""

    def save(self, stream: io.BytesIO, format: str) -> None:
        """Encode it."""


def scene_of(found: trimesh.Trimesh | trimesh.Scene) -> Scene:
    """The scene that a trimesh.Trimesh or a trimesh.Scene is.

    What is no mesh in it is passed over. Raises InputError for any other object.
    """
    builder = _Builder()
    if hasattr(found, "faces") and hasattr(found, "vertices"):
        title = str(found.metadata.get("name") or "")
        builder.add(cast("trimesh.Trimesh", found), title)
        return builder.scene((Instance(mesh=0, name=title),))
    if not (hasattr(found, "geometry") and hasattr(found, "graph")):
        raise InputError(
            f"a {type(found).__name__} is no trimesh.Trimesh or trimesh.Scene. "
            "Use Scene.from_arrays(vertices, faces) for arrays."
        )
    names = [name for name, part in found.geometry.items() if hasattr(part, "faces")]
    for name in names:
        builder.add(found.geometry[name], str(name))
    number = {name: index for index, name in enumerate(names)}
    instances = []
    for node in found.graph.nodes_geometry:
        transform, name = found.graph[node]
        if name in number:
            instances.append(Instance(mesh=number[name], transform=transform, name=str(node)))
    return builder.scene(tuple(instances))


class _Builder:
    """Meshes gathered so far, and what they are made of."""

    def __init__(self) -> None:
        self.meshes: list[Mesh] = []
        self.materials: list[Material] = []
        self.images: list[Image] = []
        self._known: dict[int, int] = {}

    def scene(self, instances: tuple[Instance, ...]) -> Scene:
        return Scene(
            meshes=tuple(self.meshes),
            instances=instances,
            materials=tuple(self.materials),
            images=tuple(self.images),
        )

    def add(self, mesh: trimesh.Trimesh, name: str) -> None:
        # vertex_normals would compute them, and merge what is sharp; the cache has them only if they were given.
        normals = mesh._cache.cache.get("vertex_normals")  # noqa: SLF001 - there is no public way
        self.meshes.append(
            Mesh(
                vertices=mesh.vertices,
                faces=mesh.faces,
                normals=normals,
                name=name,
                material=self._material(mesh.visual),
                attributes=_attributes(mesh.visual, len(mesh.vertices), len(mesh.faces)),
            )
        )

    def _material(self, visual: object) -> int | None:
        """The number of a material of a texture visual; None for other visuals."""
        given = getattr(visual, "material", None)
        if given is None or not hasattr(given, "main_color"):
            return None
        if id(given) not in self._known:
            self._known[id(given)] = len(self.materials)
            self.materials.append(_material(given, self._texture(given)))
        return self._known[id(given)]

    def _texture(self, material: object) -> Texture | None:
        picture = _first(material, "baseColorTexture", "image")
        if not hasattr(picture, "save"):
            return None
        name = f"the image of material {_first(material, 'name') or len(self.materials)!r}"
        self.images.append(Image(name=name, data=partial(_encoded, cast(Picture, picture))))
        return Texture(image=len(self.images) - 1)


def _material(given: object, texture: Texture | None) -> Material:
    is_pbr = hasattr(given, "baseColorFactor")
    mode = _first(given, "alphaMode")
    return Material(
        name=str(_first(given, "name") or ""),
        base_color=_base_color(given, textured=texture is not None),
        metallic=_number(given, "metallicFactor", 1.0 if is_pbr else 0.0),
        roughness=_number(given, "roughnessFactor", 1.0),
        double_sided=bool(_first(given, "doubleSided")),
        alpha_mode=cast(AlphaMode, mode) if mode in get_args(AlphaMode) else "OPAQUE",
        alpha_cutoff=_number(given, "alphaCutoff", 0.5),
        base_color_texture=texture,
    )


def _base_color(given: object, *, textured: bool) -> tuple[float, float, float, float]:
    """White where none is given; trimesh's own grey for that would dim a texture."""
    if hasattr(given, "baseColorFactor"):
        color = given.baseColorFactor
    else:
        color = None if textured else _first(given, "main_color")
    if color is None:
        return 1.0, 1.0, 1.0, 1.0
    red, green, blue, alpha = _scaled(color)[0].tolist()
    return red, green, blue, alpha


def _attributes(visual: object, vertices: int, faces: int) -> dict[str, Attribute]:
    """TEXCOORD_0 and COLOR_0, where there are some that fit the mesh."""
    found = {}
    uv = _first(visual, "uv")
    if uv is not None and np.shape(cast(ArrayLike, uv)) == (vertices, 2):
        # trimesh has v run up from the bottom of an image.
        found["TEXCOORD_0"] = Attribute(values=np.asarray(uv, np.float64) * (1, -1) + (0, 1))
    kind = _first(visual, "kind")
    if kind == "vertex":
        found["COLOR_0"] = Attribute(values=_scaled(_first(visual, "vertex_colors")))
    if kind == "face":
        same = np.repeat(np.arange(faces, dtype=np.int32)[:, None], 3, axis=1)
        found["COLOR_0"] = Attribute(values=_scaled(_first(visual, "face_colors")), corners=same)
    return found


def _scaled(colors: object) -> FloatArray:
    """(N, 4) colours of bytes in [0, 1]."""
    return np.asarray(colors, np.float64).reshape(-1, 4) / 255.0


def _first(given: object, *names: str) -> object:
    """The first of these attributes that is there and is not None."""
    return next(
        (value for name in names if (value := getattr(given, name, None)) is not None), None
    )


def _number(given: object, name: str, default: float) -> float:
    value = _first(given, name)
    return default if value is None else float(cast(float, value))


def _encoded(picture: Picture) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, format="PNG")
    return stream.getvalue()

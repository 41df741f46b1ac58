"""What a bake gives, and how it is kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError
from aobake.files import same_file
from aobake.findings import Finding
from aobake.meshes import formats
from aobake.meshes.lightmap import Lightmap
from aobake.meshes.scene import Scene
from aobake.plan import Plan
from aobake.settings import BakeSettings, Further, ImageSettings, StoreSettings

__all__ = ["BakedTexture", "BakedVertices", "Estimate", "save"]

Float32Array = NDArray[np.float32]
ScalarT = TypeVar("ScalarT", bound=np.generic)


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Ambient occlusion at points.

    mean : (P,) float32 in [0, 1]; 1 = open, 0 = fully occluded
    standard_error : (P,) float32, of the mean
    rays : (P,) int32, rays spent
    """

    mean: Float32Array
    standard_error: Float32Array
    rays: NDArray[np.int32]


@dataclass(frozen=True, eq=False, kw_only=True)
class BakedVertices:
    """Ambient occlusion at the vertices of a scene.

    ao : one (V_i,) float32 array per instance, in the scene's order; 1 = open, 0 = fully occluded
    standard_error : the same shapes; 0 where nothing had to be estimated
    bent_normals : one (V_i, 3) float32 array per instance, the mean open directions at unit length in the
        space of its mesh, as its normals are; None where they were not asked for
    mean_distance : one (V_i,) float32 array per instance, how far rays from there get in the mean, in scene
        units; a ray counts no farther than max_distance, or the diagonal of the scene; None where it was not
        asked for
    rays : rays spent on the whole scene
    fixed_rays : those that the same number at every point would have taken for the same root mean square
        error, by the law of the standard error; None where no tolerance was asked for
    seconds : stage -> seconds ("prepare", "build", "compile", "trace")
    findings : what was passed over, mended or is in doubt, counted and located
    warnings : the same, with what the reader had to say, one line each
    """

    scene: Scene
    settings: BakeSettings
    plan: Plan
    ao: list[Float32Array]
    standard_error: list[Float32Array]
    rays: int
    fixed_rays: int | None = None
    seconds: Mapping[str, float]
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]
    bent_normals: list[Float32Array] | None = None
    mean_distance: list[Float32Array] | None = None

    @property
    def further(self) -> Mapping[Further, list[Float32Array]]:
        """What was asked for besides occlusion, one array per instance each."""
        kept: dict[Further, list[Float32Array] | None] = {
            "bent_normals": self.bent_normals,
            "mean_distance": self.mean_distance,
        }
        return {name: values for name, values in kept.items() if values is not None}


@dataclass(frozen=True, eq=False, kw_only=True)
class BakedTexture:
    """Ambient occlusion in images that lie on the surfaces of a scene.

    lightmap : the images, one or more, and where on them each instance lies
    coverages : (H, W) bool of each image, the texels that surfaces lie on; the others are filled
    standard_errors : (H, W) float32 of each image, as it was traced; 0 where nothing was estimated
    layout : in one sentence for each image, where its texture coordinates come from
    rays : rays spent on the whole scene
    seconds : stage -> seconds ("prepare", "unwrap", "build", "compile", "texels", "trace", "denoise",
        "finish")
    findings, warnings : as those of BakedVertices
    """

    scene: Scene
    settings: BakeSettings
    plan: Plan
    lightmap: Lightmap
    coverages: tuple[NDArray[np.bool_], ...]
    standard_errors: tuple[Float32Array, ...]
    layout: tuple[str, ...]
    rays: int
    seconds: Mapping[str, float]
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]

    @property
    def images(self) -> tuple[Float32Array, ...]:
        """(H, W) float32 in [0, 1] each, row 0 at the top; 1 = open."""
        return self.lightmap.pages

    @property
    def bent_normals(self) -> tuple[Float32Array, ...] | None:
        """(H, W, 3) float32 of each image, unit length, in the space of settings.bent_space; None: not asked for."""
        return None if self.lightmap.bent is None else self.lightmap.bent.pages

    @property
    def image(self) -> Float32Array:
        """The one image. Raises InputError where there are several, or none."""
        return self._one(self.images)

    @property
    def coverage(self) -> NDArray[np.bool_]:
        """That of the one image. Raises InputError where there are several, or none."""
        return self._one(self.coverages)

    def _one(self, several: tuple[NDArray[ScalarT], ...]) -> NDArray[ScalarT]:
        if len(several) != 1:
            raise InputError(
                f"there are {len(several)} images: take them from images and coverages, "
                'or bake with atlas="scene" for a single one.'
            )
        return several[0]


def save(
    baked: BakedVertices | BakedTexture,
    path: str | Path,
    *,
    store: StoreSettings | None = None,
    image: ImageSettings | None = None,
    force: bool = False,
) -> tuple[Path, ...]:
    """Write the asset that was baked, with its ambient occlusion and nothing else changed.

    path : a file of a format that can hold it (aobake.meshes.formats.WRITABLE for vertices,
        TEXTURE_WRITABLE for textures), or an image of a texture alone; where it is the format that the
        scene was read from, the source document is patched
    store, image : how values at vertices, and how images, are kept
    force : allows the files that the scene was read from to be replaced
    Returns the files written, path first. Raises OutputError; a file appears whole or not at all.
    """
    target = Path(path)
    source = baked.scene.source
    if source is not None and not force:
        for read in source.files:
            if same_file(read, target):
                raise OutputError(
                    f"{target}: this is a file that the asset was read from. "
                    "Give another name, or allow it to be replaced (--force)."
                )
    if isinstance(baked, BakedTexture):
        image = image or ImageSettings()
        formats.check_texture_target(baked.scene, target, image, baked.lightmap)
        return formats.write_texture_ao(baked.scene, baked.lightmap, target, image)
    store = store or StoreSettings()
    formats.check_target(baked.scene, target, store, baked.further)
    return formats.write_vertex_ao(baked.scene, baked.ao, target, store, baked.further)

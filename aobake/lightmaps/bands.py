"""A texture bake in parts: what is decided before the first ray, and bands of rows that can be traced anywhere.

What comes of a band depends on the scene, the settings and the layout alone, so a bake can be cut between any
two bands, over threads, processes or machines, and gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from aobake.atlas.layout import Layout
from aobake.atlas.material_texels import MaterialTexels
from aobake.atlas.post import TracedPage
from aobake.findings import EXAMPLES, Finding, FindingKind
from aobake.meshes.scene import Scene
from aobake.open_sky import OpenSky
from aobake.plan import Plan
from aobake.prepare import Prepared
from aobake.settings import BakeSettings

__all__ = ["Band", "Marked", "Tally", "TextureBake", "TracedBand", "bands_of"]

BAND_SAMPLES = 1 << 18  # of a band of rows; each takes about 200 bytes while it is traced


@dataclass(frozen=True, eq=False, kw_only=True)
class TextureBake:
    """What is decided before the first ray of a texture bake.

    Each process makes its own (lightmaps.prepare_texture): a built world cannot be pickled. The layout can,
    and should be handed on: unwrapping it again takes long, and may end otherwise where its time is up.

    materials : what materials say at texels; images are decoded when they are first looked up
    ground : the height of the ground along its axis, or None
    sky : what is known of points that everything lies below
    findings : what was found about the meshes
    seconds : stage -> seconds
    """

    scene: Scene
    settings: BakeSettings
    plan: Plan
    prepared: Prepared
    layout: Layout
    materials: MaterialTexels
    ground: float | None
    sky: OpenSky
    findings: tuple[Finding, ...]
    seconds: Mapping[str, float]

    @property
    def denoises(self) -> bool:
        """Whether a denoiser will smooth the pages, and wants to know normals."""
        return self.plan.effects["denoise"].on


@dataclass(frozen=True)
class Band:
    """Successive rows of one page, which are traced at once. page : index into Layout.pages."""

    page: int
    rows: range


@dataclass(frozen=True)
class Marked:
    """count : samples in some state; faces : the lowest numbers of the faces that they lie on."""

    count: int = 0
    faces: tuple[int, ...] = ()

    def with_more(self, other: Marked) -> Marked:
        """Both together, in any order."""
        faces = sorted({*self.faces, *other.faces})
        return Marked(self.count + other.count, tuple(faces[:EXAMPLES]))


Tally: TypeAlias = Mapping[
    tuple[int, FindingKind], Marked
]  # of the samples of an instance in a state


@dataclass(frozen=True, eq=False, kw_only=True)
class TracedBand:
    """What came of a band; it can be pickled.

    texels : the rows of the band
    rays : spent; samples : how many points were traced from, under_open_sky : below how many everything lies
    warnings : textures that could not be used, as far as this process has looked at them
    seconds : stage -> seconds
    """

    band: Band
    texels: TracedPage
    rays: int
    samples: int
    under_open_sky: int
    tally: Tally
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]


def bands_of(bake: TextureBake) -> tuple[Band, ...]:
    """All bands of a bake, page after page, from top to bottom; none without a page.

    They are a matter of the settings alone, not of the machine: with tolerance_of="rms" the points of a band
    share their rays, and points that float32 cannot resolve together are told apart within a band.
    """
    size, finer = bake.settings.size, bake.settings.supersample
    height = max(1, BAND_SAMPLES // (size * finer * finer))
    return tuple(
        Band(page=page, rows=range(start, min(start + height, size)))
        for page in range(len(bake.layout.pages))
        for start in range(0, size, height)
    )

"""Small pictures of an asset before and after its bake, and a page that shows it: from what is in memory already.

A picture costs as little as it can, since there is one for every asset of a batch. One pass of rays serves both:
they differ by the ambient occlusion alone. Lights cast no shadows, so that what darkens is what was baked.
Pixels at edges get more rays than the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.batch.palette import png_of
from aobake.batch.tasks import Pictures
from aobake.errors import AobakeError
from aobake.jobs import Done
from aobake.meshes.lightmap import Kept, Placing
from aobake.meshes.scene import Mesh, Scene
from aobake.results import BakedTexture, BakedVertices
from aobake.shading.camera import View, axes_from, extent, framing
from aobake.shading.columns import dot, some, unit
from aobake.shading.materials import Appearance, Baked, Look, appearance, look_of
from aobake.shading.seen import Seen, seen
from aobake.shading.stage import Stage, stage_of
from aobake.shading.tone import to_srgb
from aobake.tracing.conditioning import unit_frame
from aobake.tracing.primary import nearest_hits

__all__ = ["HEIGHT_PX", "WIDTH_PX", "pictures_of", "thumbnails"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

WIDTH_PX, HEIGHT_PX = 128, 96
AZIMUTH, ELEVATION = 30.0, 20.0
HALF_HEIGHT = math.tan(math.radians(15.0))
AMBIENT, KEY = np.float32(0.72), np.float32(0.36)
KEY_FROM = (-0.5, 0.75, 0.45)  # over the camera's left shoulder: right, up, backward
BACKDROP = np.float32(0.22)  # linear; neither white nor black assets are lost before it
LAYERS = 8  # of cut-out surfaces, one behind the other
PAST = np.float32(1.0 + 1e-5)
EDGE_PLACES = np.array([[0.25, 0.125], [0.875, 0.25], [0.125, 0.75], [0.75, 0.875]])
SHARP_EDGE = 0.9  # cosine between the normals of neighbours
DISPLAYED = np.rint(255.0 * to_srgb(np.linspace(0.0, 1.0, 4096, dtype=np.float32))).astype(np.uint8)


def pictures_of(done: Done, kind: Pictures) -> tuple[Mapping[str, bytes], tuple[str, ...]]:
    """What a page shows of a job that is done, and what to say of what could not be made.

    kind : "thumbnails": "before" and "after", as PNG; "viewers": "viewer" as well, an HTML page
    Empty for "none", and for an asset of which nothing can be seen. A texture is shown by its own texels.
    """
    found: dict[str, bytes] = {}
    trouble: list[str] = []
    if kind != "none":
        try:
            found |= thumbnails(done.baked)
        except AobakeError as error:
            trouble.append(f"no pictures were made: {error}")
    if kind == "viewers" and done.report.outputs:
        try:
            found["viewer"] = _viewer(Path(done.report.outputs[0].path), done)
        except AobakeError as error:
            trouble.append(f"no viewer was made: {error}")
    return found, tuple(trouble)


def thumbnails(baked: BakedVertices | BakedTexture) -> Mapping[str, bytes]:
    """ "before" and "after" of an asset, as PNG; nothing for one that has no triangle to be seen.

    Raises EngineError where Embree cannot be used.
    """
    scene = baked.scene
    clouds = extent(scene)
    if scene.triangles == 0 or not clouds:
        return {}
    axes = axes_from(AZIMUTH, ELEVATION, baked.settings.ground or "+y")
    with np.errstate(all="ignore"):  # coordinates of any size; what comes of it is checked below
        view = framing(clouds, axes, HALF_HEIGHT, WIDTH_PX / HEIGHT_PX)
        frame = unit_frame(clouds)
        if not (np.isfinite(view.position).all() and math.isfinite(frame.scale)):
            return {}
        stage = stage_of(scene, frame)
        at_vertices = Baked(ao=baked.ao) if isinstance(baked, BakedVertices) else None
        look = look_of(scene, at_vertices, WIDTH_PX)
        before, after = _Camera(stage, view, look, baked).pair()
    return {"before": png_of(before), "after": png_of(after)}


@dataclass(frozen=True, eq=False)
class _Pixels:
    """What N rays show: colours (2, 3, N) before and after, linear; normals (3, N), zeros for a miss."""

    colors: Float32Array
    normals: Float32Array


@dataclass(frozen=True, eq=False)
class _Camera:
    """An asset and its bake before a camera."""

    stage: Stage
    view: View
    look: Look
    baked: BakedVertices | BakedTexture

    def pair(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """(H, W, 3) before and after, as displays take them."""
        y, x = np.divmod(np.arange(WIDTH_PX * HEIGHT_PX), WIDTH_PX)
        first = self.shot(x + 0.5, y + 0.5)
        edges = np.flatnonzero(_edges(first.normals.reshape(3, HEIGHT_PX, WIDTH_PX)))
        colors = first.colors
        if len(edges):
            across = (x[edges] + EDGE_PLACES[:, :1]).reshape(-1)
            down = (y[edges] + EDGE_PLACES[:, 1:]).reshape(-1)
            finer = self.shot(across, down).colors.reshape(2, 3, len(EDGE_PLACES), len(edges))
            colors[:, :, edges] = finer.mean(axis=2)
        shown = _as_displayed(colors).reshape(2, 3, HEIGHT_PX, WIDTH_PX)
        before, after = np.moveaxis(shown, 1, -1)
        return before, after

    def shot(self, x: FloatArray, y: FloatArray) -> _Pixels:
        """Through places (N,) of the picture, in pixels from its top left corner."""
        origins, directions = self._rays(x, y)
        pixels = _Pixels(np.full((2, 3, len(x)), BACKDROP), np.zeros((3, len(x)), np.float32))
        active, near = np.arange(len(x)), np.zeros(len(x), np.float32)
        for _ in range(LAYERS):
            tree, towards = self.stage.tree, some(directions, active)
            hits = nearest_hits(tree, some(origins, active), towards, near)
            met = np.flatnonzero(hits.thing >= 0)
            hits, active = hits.only(met), active[met]
            points = seen(self.stage, hits, some(directions, active))
            holes = self._paint(points, active, pixels)
            active, near = active[holes], hits.distance[holes] * PAST
            if len(active) == 0:
                break
        return pixels

    def _rays(self, x: FloatArray, y: FloatArray) -> tuple[Float32Array, Float32Array]:
        pixel = 2.0 * self.view.half_height / HEIGHT_PX
        across = (pixel * (x - WIDTH_PX / 2)).astype(np.float32)
        above = (pixel * (HEIGHT_PX / 2 - y)).astype(np.float32)
        right, up, backward = self.view.axes.astype(np.float32)[:, :, None]
        position = self.stage.frame.apply(self.view.position[None]).astype(np.float32)
        directions = unit(across * right + above * up - backward)
        return np.repeat(position.T, len(x), axis=1), directions

    def _paint(self, points: Seen, rows: NDArray[np.int64], pixels: _Pixels) -> NDArray[np.int64]:
        """Paint what is solid; returns which of the points are holes, to be looked through."""
        looks = appearance(self.look, points)
        solid = np.flatnonzero(looks.alpha >= 0.5)
        key = np.array(KEY_FROM) @ self.view.axes
        towards = (key / np.linalg.norm(key)).astype(np.float32)[:, None]
        direct = KEY * np.maximum(dot(points.normal, towards), 0.0)
        painted = rows[solid]
        open_sky = np.ones_like(direct)
        baked = self._occlusion(looks, points)
        for colors, occlusion in zip(pixels.colors, (open_sky, baked), strict=True):
            lit = (AMBIENT * occlusion + direct) * looks.albedo + looks.emitted
            _put(colors, painted, some(lit, solid))
        _put(pixels.normals, painted, some(points.normal, solid))
        return np.flatnonzero(looks.alpha < 0.5)

    def _occlusion(self, looks: Appearance, points: Seen) -> Float32Array:
        """(N,) what was baked, at points."""
        if isinstance(self.baked, BakedVertices):
            return looks.ao
        found = np.ones(len(points.face), np.float32)
        for number in np.unique(points.instance):
            rows = np.flatnonzero(points.instance == number)
            face, weights = points.face[rows], some(points.weights, rows)
            found[rows] = _in_texture(self.baked, int(number), face, weights)
        return found


def _put(vectors: Float32Array, chosen: NDArray[np.int64], values: Float32Array) -> None:
    """Set the chosen ones, all different, of (3, N) vectors."""
    for row, new in zip(vectors, values, strict=True):
        row[chosen] = new


def _as_displayed(linear: Float32Array) -> NDArray[np.uint8]:
    """Values of any shape as displays take them, out of a table: a power for each takes twice as long."""
    within = np.fmax(np.fmin(linear, np.float32(1.0)), np.float32(0.0))  # also what is no number
    rows = (within * np.float32(len(DISPLAYED) - 1)).astype(np.int64)
    return np.asarray(DISPLAYED[rows], np.uint8)


def _edges(normals: Float32Array) -> BoolArray:
    """(H W,) pixels that differ from a neighbour; normals : (3, H, W), zeros where nothing is."""
    there: BoolArray = np.asarray(normals.any(axis=0))
    edge = np.zeros(there.shape, bool)
    for here, beside in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
        alike = dot(normals[(slice(None), *here)], normals[(slice(None), *beside)])
        differ = (alike < SHARP_EDGE) & (there[here] | there[beside])
        edge[here] |= differ
        edge[beside] |= differ
    return edge.reshape(-1)


def _in_texture(
    baked: BakedTexture, number: int, face: NDArray[np.int32], weights: Float32Array
) -> Float32Array | float:
    """(N,) the texels of an instance; face (N,) and weights (3, N) of points; 1 where it has none."""
    placing = baked.lightmap.placings[number]
    mesh = baked.scene.meshes[baked.scene.instances[number].mesh]
    corners = None if placing is None else _coordinates(mesh, placing, face)
    if placing is None or corners is None:
        return 1.0
    from aobake.atlas.lookup import sample

    uv = np.einsum("kn,nkc->nc", weights, corners)
    return sample(baked.lightmap.pages[placing.page], uv)[:, 0]


def _coordinates(mesh: Mesh, placing: Placing, face: NDArray[np.int32]) -> FloatArray | None:
    """(N, 3, 2) texture coordinates of the corners of faces."""
    layout = placing.layout
    if isinstance(layout, Kept):
        corners = mesh.at_corners(f"TEXCOORD_{layout.uv_set}")
        return None if corners is None else corners[face][:, :, :2]
    return layout.uv[layout.faces[face]]


def _viewer(output: Path, done: Done) -> bytes:
    """The page that shows an output, read back as it was written."""
    from aobake.meshes.formats import load
    from aobake.viewer import packed_glb, page_of

    scene: Scene = load(output)
    facts = (f"{done.report.triangles:,} triangles", f"{done.report.command} bake")
    return page_of(packed_glb(scene).glb, output.name, facts, scripts_in="")

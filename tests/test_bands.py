"""A texture bake cut into bands: whoever traces them, and in whatever order, the same comes of it."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import replace

import pytest

from aobake import (
    BakedTexture,
    BakeSettings,
    InputError,
    Instance,
    Scene,
    bake_texture,
)
from aobake.lightmaps import (
    Band,
    TracedBand,
    bands,
    bands_of,
    prepare_texture,
    put_together,
    trace_bands,
)
from aobake.meshes.scene import Attribute, Image, Material, Texture
from aobake.settings import ToleranceOf
from tests.scenes import affine, box, floor, icosphere, mesh_of, moved

BAKE = BakeSettings(size=40, rays=32, denoise="off", blend="multiply", normal_map=True, threads=1)
ROWS = [range(1), range(1, 8), range(8, 29), range(29, 30), range(30, 40)]


def missing() -> bytes:
    raise InputError("dust.png: there is no such file. Check the path.")


def scene() -> Scene:
    """A floor of a broken material, a box that rests on it, and balls that share their place in the file."""
    ground, ball = floor(1.0, cells=3), icosphere(1, 0.2)
    cube = moved(box(), 0.5, (0.0, 0.0, 0.25))
    there = [affine(1.0, place) for place in ((0.6, 0.0, 0.3), (-0.6, 0.0, 0.15))]
    uv = Attribute(values=(ground.vertices[:, :2] + 1.0) / 2.0)
    return Scene(
        meshes=(
            mesh_of(ground, name="floor", material=0, attributes={"TEXCOORD_0": uv}),
            mesh_of(cube, name="cube"),
            mesh_of(ball, normals=ball.vertices, name="ball"),
        ),
        instances=(
            Instance(mesh=0),
            Instance(mesh=1),
            *(Instance(mesh=2, transform=transform, stored_with=2) for transform in there),
        ),
        materials=(
            Material(
                name="dusty",
                occlusion_texture=Texture(image=0),
                normal_texture=Texture(image=1),
            ),
        ),
        images=(
            Image(name="dust.png", data=missing),
            Image(name="bumps.png", data=lambda: b"no image"),
        ),
    )


def everything(found: BakedTexture) -> tuple[object, ...]:
    """All of a result that must not depend on how it came about."""
    arrays = (*found.images, *found.standard_errors, *found.coverages, *(found.bent_normals or ()))
    return (
        tuple(array.tobytes() for array in arrays),
        found.rays,
        found.findings,
        found.warnings,
        found.plan,
        found.layout,
    )


def cut_at(rows: Sequence[range], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the bands of every page be these rows."""

    def cut(bake: bands.TextureBake) -> tuple[Band, ...]:
        pages = range(len(bake.layout.pages))
        return tuple(Band(page=page, rows=some) for page in pages for some in rows)

    monkeypatch.setattr("aobake.lightmaps.pages.bands_of", cut)
    monkeypatch.setattr("aobake.lightmaps.bake.bands_of", cut)


@pytest.mark.parametrize("supersample", [1, 2])
@pytest.mark.parametrize(
    "rows", [ROWS, [range(k, k + 1) for k in range(40)]], ids=["uneven", "one"]
)
def test_any_cut_into_rows_gives_the_same(
    rows: list[range], supersample: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = replace(BAKE, atlas="mesh", supersample=supersample, bent_normals=True)
    whole = bake_texture(scene(), settings)
    assert {finding.kind for finding in whole.findings} >= {"enclosed"}
    broken = [line for line in whole.warnings if "dust.png" in line or "bumps.png" in line]
    assert len(broken) == 2
    assert broken == sorted(broken)
    cut_at(rows, monkeypatch)
    assert everything(bake_texture(scene(), settings)) == everything(whole)


def parts_of_others(settings: BakeSettings, layout: bytes, workers: int) -> list[TracedBand]:
    """All bands of the scene, traced by several that know nothing of each other, in no good order."""
    parts = []
    for worker in range(workers):
        bake = prepare_texture(scene(), settings, layout=pickle.loads(layout))
        some = list(trace_bands(bake, bands_of(bake)[worker::workers][::-1]))
        parts.append(pickle.dumps(some))
    return [part for some in reversed(parts) for part in pickle.loads(some)]


def test_bands_that_others_traced_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = bake_texture(scene(), replace(BAKE, threads=2))
    monkeypatch.setattr(bands, "BAND_SAMPLES", 7 * 40)
    bake = prepare_texture(scene(), BAKE)
    assert len(bands_of(bake)) == 6
    parts = parts_of_others(BAKE, pickle.dumps(bake.layout), workers=4)
    assert everything(put_together(bake, parts)) == everything(whole)


@pytest.mark.parametrize("tolerance_of", ["each", "rms"])
def test_bands_that_others_traced_meet_a_tolerance_in_the_same_way(
    tolerance_of: ToleranceOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With "rms" the points of a band share their rays: so it matters that a band is the same to all."""
    monkeypatch.setattr(bands, "BAND_SAMPLES", 7 * 40)
    settings = replace(BAKE, tolerance=0.02, tolerance_of=tolerance_of, max_rays=256)
    bake = prepare_texture(scene(), settings)
    parts = parts_of_others(settings, pickle.dumps(bake.layout), workers=3)
    found = put_together(bake, parts)
    assert everything(found) == everything(bake_texture(scene(), settings))


def test_a_handed_on_layout_is_not_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    layout = prepare_texture(scene(), BAKE).layout
    monkeypatch.delattr("aobake.lightmaps.bake.lay_out")
    again = prepare_texture(scene(), BAKE, layout=pickle.loads(pickle.dumps(layout)))
    assert len(again.layout.pages) == 1
    first, second = again.layout.placings[2:]
    assert first is not None
    assert first is second  # of what is stored together, also behind a pickle


def test_bands_cover_every_row_once_however_large_the_pages_are() -> None:
    bake = prepare_texture(scene(), replace(BAKE, atlas="mesh", size=1024, supersample=4))
    found = bands_of(bake)
    assert len(bake.layout.pages) == 3
    for page in range(3):
        rows = [row for band in found if band.page == page for row in band.rows]
        assert rows == list(range(1024))
    assert max(len(band.rows) for band in found) * 1024 * 16 <= bands.BAND_SAMPLES


def test_bands_that_are_missing_doubled_or_foreign_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bands, "BAND_SAMPLES", 10 * 40)
    bake = prepare_texture(scene(), BAKE)
    parts = list(trace_bands(bake, bands_of(bake)))
    with pytest.raises(InputError, match="page 0, rows 10 to 19 is missing"):
        put_together(bake, [parts[0], *parts[2:]])
    with pytest.raises(InputError, match="rows 30 to 39 came twice"):
        put_together(bake, [*parts, parts[-1]])
    strange = replace(parts[0], band=Band(page=0, rows=range(9)))
    with pytest.raises(InputError, match=r"rows 0 to 8 .* none of this bake"):
        put_together(bake, [strange])

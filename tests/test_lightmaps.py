"""Bakes to textures: what texels hold, on whatever layout, for any cut into bands and threads."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import (
    BakedTexture,
    BakeSettings,
    InputError,
    Instance,
    Material,
    Scene,
    bake_texture,
    images,
)
from aobake.atlas.lookup import sample
from aobake.lightmaps import bands, samples
from aobake.meshes.scene import Attribute, Image, Texture
from tests.scenes import FloatArray, Triangles, affine, box, icosphere, mesh_of, moved, patch

SQUARE = patch((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
CUBE = moved(box(), 0.5)  # 0.5 wide
HALF = (0.5, 0.5, 0.5)
FLAT = (0.5, 0.5, 1.0)  # a normal map that turns nothing
TILTED = (0.8, 0.5, 0.9)  # one that turns by 37 degrees


def uniform(name: str, color: tuple[float, float, float]) -> Image:
    """An image of one colour."""
    pixels = np.broadcast_to(np.array(color, np.float32), (4, 4, 3))
    return Image(name=name, data=lambda: images.encode(pixels, "exr", "float"))


def on_its_own_square(mesh: Triangles, half: float = 1.0, **material: object) -> Scene:
    """A scene of a flat mesh whose texture coordinates are its x and y, from corner to corner."""
    uv = (mesh.vertices[:, :2] / half + 1.0) / 2.0
    attributes = {"TEXCOORD_0": Attribute(values=uv)}
    parts = mesh_of(mesh, name="floor", material=0, attributes=attributes)
    given = {"name": "plain", **material}
    return Scene(
        meshes=(parts,),
        instances=(Instance(mesh=0),),
        materials=(Material(**given),),  # type: ignore[arg-type]
        images=(uniform("half", HALF), uniform("flat", FLAT), uniform("tilted", TILTED)),
    )


def beside(scene: Scene, *others: Triangles) -> Scene:
    """The scene with more to occlude it; the others lie on the same page, unwrapped."""
    more = tuple(mesh_of(other, name=f"other {n}") for n, other in enumerate(others))
    placed = tuple(Instance(mesh=len(scene.meshes) + number) for number in range(len(more)))
    return Scene(
        meshes=(*scene.meshes, *more),
        instances=(*scene.instances, *placed),
        materials=scene.materials,
        images=scene.images,
    )


def baked(scene: Scene, **changes: object) -> BakedTexture:
    given = {"size": 64, "rays": 64, "denoise": "off", **changes}
    return bake_texture(scene, BakeSettings(**given))  # type: ignore[arg-type]


def texel_places(size: int, half: float) -> tuple[FloatArray, FloatArray]:
    """x and y of the middles of the texels of a page whose coordinates are those of the plane."""
    middle = ((np.arange(size) + 0.5) / size * 2.0 - 1.0) * half
    x, y = np.meshgrid(middle, middle)
    return x, y


def test_a_floor_under_a_ball_has_the_closed_form_at_every_texel() -> None:
    """A ball of radius R that rests on the floor hides 1 - (R^2 / (rho^2 + R^2))^1.5 of it at rho."""
    floor = moved(SQUARE, 4.0)
    scene = beside(on_its_own_square(floor, 4.0), moved(icosphere(4), shift=(0.0, 0.0, 1.0)))
    found = baked(scene, atlas="mesh", rays=256)
    x, y = texel_places(64, 4.0)
    exact = 1.0 - (1.0 / (x**2 + y**2 + 1.0)) ** 1.5
    away = x**2 + y**2 > 0.1  # where the ball touches, its facets are what is seen
    error = (found.images[0] - exact)[away]
    facets = 2e-3
    assert np.sqrt(np.mean(error**2)) < 0.006
    claimed = found.standard_errors[0][away]
    assert np.mean(np.abs(found.images[0] - exact)[away] <= 2.0 * claimed + facets) > 0.93


def test_a_convex_body_is_white_all_over() -> None:
    found = baked(Scene.from_arrays(*moved(box(), np.diag([1.0, 2.0, 3.0]))))
    assert found.coverage.mean() > 0.3
    assert found.image.min() == 1.0


def test_a_smoothly_shaded_coarse_ball_does_not_darken_itself() -> None:
    ball = icosphere(1)
    scene = Scene.from_arrays(*ball, normals=ball.vertices)
    assert baked(scene).image.min() == 1.0


@pytest.mark.parametrize("supersample", [1, 2])
def test_bands_and_threads_do_not_change_a_byte(
    supersample: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = beside(on_its_own_square(SQUARE), moved(CUBE, shift=(0.0, 0.0, 0.4)))
    whole = baked(scene, supersample=supersample, threads=1)
    monkeypatch.setattr(bands, "BAND_SAMPLES", 777)
    cut = baked(scene, supersample=supersample, threads=3)
    assert cut.image.tobytes() == whole.image.tobytes()
    assert cut.standard_errors[0].tobytes() == whole.standard_errors[0].tobytes()
    assert cut.rays == whole.rays


@pytest.mark.parametrize("supersample", [1, 2])
def test_the_tiles_that_texels_are_traced_in_do_not_change_a_byte(
    supersample: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = beside(on_its_own_square(SQUARE), moved(CUBE, shift=(0.0, 0.0, 0.4)))
    tiled = baked(scene, supersample=supersample, bent_normals=True)
    monkeypatch.setattr(samples, "TILE_PX", 1 << 15)
    by_row = baked(scene, supersample=supersample, bent_normals=True)
    assert tiled.image.tobytes() == by_row.image.tobytes()
    assert tiled.standard_errors[0].tobytes() == by_row.standard_errors[0].tobytes()
    assert tiled.bent_normals is not None
    assert by_row.bent_normals is not None
    assert tiled.bent_normals[0].tobytes() == by_row.bent_normals[0].tobytes()


def test_four_samples_a_texel_halve_the_error() -> None:
    scene = beside(on_its_own_square(SQUARE), moved(CUBE, shift=(0.0, 0.0, 0.6)))
    one, four = baked(scene), baked(scene, supersample=2)
    inside = one.coverage & (one.standard_errors[0] > 0) & (four.standard_errors[0] > 0)
    ratio = np.median(four.standard_errors[0][inside] / one.standard_errors[0][inside])
    assert 0.4 < ratio < 0.6
    assert four.rays > 3.0 * one.rays


def test_every_bilinear_lookup_on_the_surface_reads_baked_texels_alone() -> None:
    scene = Scene.from_arrays(*icosphere(2))
    found = baked(scene)
    placing = found.lightmap.placings[0]
    assert placing is not None
    corners = placing.layout.uv[placing.layout.faces]  # type: ignore[union-attr]
    share = np.random.default_rng(0).dirichlet((0.3, 0.3, 0.3), size=(len(corners), 20))
    places = np.einsum("fsc,fcx->fsx", share, corners).reshape(-1, 2)
    assert sample(found.coverage.astype(np.float32), places).min() == 1.0


def test_what_is_stored_together_gets_the_mean_of_its_instances() -> None:
    scene = on_its_own_square(SQUARE)
    apart = affine(1.0, (0.0, 0.0, 50.0))
    both = Scene(
        meshes=scene.meshes,
        instances=(
            Instance(mesh=0, stored_with=0),
            Instance(mesh=0, transform=apart, stored_with=0),
        ),
        materials=scene.materials,
    )
    lid = moved(patch((-9, -9, 0.2), (-9, 9, 0.2), (9, 9, 0.2), (9, -9, 0.2)))
    covered = beside(both, lid)
    found = baked(covered, rays=256)
    first = found.lightmap.placings[0]
    assert first is found.lightmap.placings[1]
    shown = found.image[found.coverage]
    assert np.median(shown[shown < 0.9]) == pytest.approx(0.5, abs=0.02)


def test_an_occlusion_texture_is_multiplied_in_where_that_is_asked_for() -> None:
    scene = on_its_own_square(SQUARE, occlusion_texture=Texture(image=0), occlusion_strength=0.5)
    assert baked(scene).image.min() == 1.0
    multiplied = baked(scene, blend="multiply").image
    assert multiplied == pytest.approx(0.75)  # 1 + 0.5 (0.5 - 1)


def test_a_flat_normal_map_changes_nothing_and_a_tilted_one_turns_the_hemisphere() -> None:
    """Beside a high wall at x = 1 the floor sees (1 - cos) / 2 less, and more of it when turned to it."""
    wall = patch((1, -50, 0), (1, 50, 0), (1, 50, 50), (1, -50, 50))
    plain = baked(beside(on_its_own_square(SQUARE), wall), rays=256, atlas="mesh")
    flat = on_its_own_square(SQUARE, normal_texture=Texture(image=1))
    same = baked(beside(flat, wall), rays=256, atlas="mesh", normal_map=True)
    assert same.images[0] == pytest.approx(plain.images[0], abs=0.02)
    tilted = on_its_own_square(SQUARE, normal_texture=Texture(image=2))
    turned = baked(beside(tilted, wall), rays=256, atlas="mesh", normal_map=True)
    assert np.mean(turned.images[0]) < np.mean(plain.images[0]) - 0.1


def test_a_broken_image_of_a_material_is_said_and_passed_over() -> None:
    def missing() -> bytes:
        raise InputError("ao.png: there is no such file. Check the path.")

    scene = on_its_own_square(SQUARE, occlusion_texture=Texture(image=0))
    scene = Scene(
        meshes=scene.meshes,
        instances=scene.instances,
        materials=scene.materials,
        images=(Image(name="ao.png", data=missing),),
    )
    found = baked(scene, blend="multiply")
    assert found.image.min() == 1.0
    assert any("ao.png" in line for line in found.warnings)


def test_a_scene_without_area_gives_no_image() -> None:
    nothing = Scene.from_arrays(np.zeros((3, 3)), [[0, 1, 2]])
    found = baked(nothing)
    assert found.images == ()
    assert found.lightmap.placings == (None,)
    with pytest.raises(InputError, match="0 images"):
        _ = found.image


def test_progress_ends_a_bake_by_what_it_raises() -> None:
    class Enough(Exception):
        """Nobody waits any longer."""

    def stop(stage: str, done: int, total: int) -> None:
        if stage == "trace":
            raise Enough

    with pytest.raises(Enough):
        bake_texture(Scene.from_arrays(*icosphere(2)), BakeSettings(size=64), progress=stop)


def test_progress_never_goes_back() -> None:
    """Also where several instances share a place: their turns are parts of one trace."""
    square, cube = on_its_own_square(SQUARE), Scene.from_arrays(*CUBE)
    others = [
        Instance(mesh=1, transform=affine(1.0, (x, 0.0, 0.0)), stored_with=1)
        for x in (0.0, 2.0, 4.0)
    ]
    scene = Scene(
        meshes=(*square.meshes, *cube.meshes),
        instances=(*square.instances, *others),
        materials=square.materials,
        images=square.images,
    )
    seen: list[int] = []

    def note(stage: str, done: int, total: int) -> None:
        if stage == "trace":
            seen.append(done)

    settings = BakeSettings(size=64, rays=64, denoise="off", atlas="mesh")
    bake_texture(scene, settings, progress=note)
    assert len(seen) > 3
    assert seen == sorted(seen)


def test_instances_of_one_name_are_told_of_together() -> None:
    """Five thousand of them would be as many lines."""
    floor = on_its_own_square(SQUARE)
    several = tuple(Instance(mesh=0, transform=affine(1.0, (4.0 * n, 0.0, 0.0))) for n in range(3))
    boxes = [moved(CUBE, shift=(4.0 * n, 0.0, 0.25)) for n in range(3)]
    scene = beside(
        Scene(
            meshes=floor.meshes,
            instances=several,
            materials=floor.materials,
            images=floor.images,
        ),
        *boxes,
    )
    told = [f for f in baked(scene, uv="unwrap").findings if f.kind == "enclosed"]
    assert len({f.where for f in told}) == len(told)
    (floors,) = (f for f in told if "'floor'" in f.where)
    (first,) = (f for f in told if "'other 0'" in f.where)
    assert floors.count > 1.5 * first.count


def test_strict_refuses_what_it_finds_at_texels() -> None:
    """The floor under a box is face to face with it."""
    scene = beside(on_its_own_square(SQUARE), moved(CUBE, shift=(0.0, 0.0, 0.25)))
    assert any("face to face" in line for line in baked(scene).warnings)
    with pytest.raises(InputError, match="without strict"):
        baked(scene, strict=True)


def seam_steps(found: BakedTexture, mesh: Triangles) -> NDArray[np.float32]:
    """How far bilinear lookups on both sides of every edge of a mesh differ."""
    placing = found.lightmap.placings[0]
    assert placing is not None
    uv = placing.layout.uv[placing.layout.faces]  # type: ignore[union-attr]
    sides: dict[tuple[int, int], list[FloatArray]] = {}
    for f, face in enumerate(mesh.faces.tolist()):
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            ends = uv[f, [k, (k + 1) % 3]]
            sides.setdefault((min(a, b), max(a, b)), []).append(ends if a < b else ends[::-1])
    t = np.linspace(0.02, 0.98, 9)[:, None]
    steps = []
    for first, second in (pair for pair in sides.values() if len(pair) == 2):
        values = [sample(found.images[0], e[0] * (1 - t) + e[1] * t) for e in (first, second)]
        steps.append(np.abs(values[0] - values[1]).max())
    return np.array(steps, np.float32)


def test_a_ball_in_many_charts_shows_no_seam() -> None:
    ball = icosphere(3)
    scene = Scene.from_arrays(*ball, normals=ball.vertices)
    scene = beside(scene, moved(SQUARE, 5.0, (0.0, 0.0, -1.2)))
    found = baked(scene, size=256, rays=256, atlas="mesh")
    assert seam_steps(found, ball).max() <= 0.01

"""Where surfaces lie on images: what is kept, what is unwrapped, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from aobake import BakeSettings, InputError, Instance, Material, Mesh, Scene
from aobake.atlas.layout import Layout, lay_out
from aobake.meshes.lightmap import Kept, Unwrapped
from aobake.meshes.scene import Attribute
from aobake.meshes.surfaces import surfaces_of
from aobake.prepare import build
from tests.scenes import FloatArray, Triangles, affine, mesh_of, patch

SQUARE = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))


def textured(
    mesh: Triangles = SQUARE,
    shift: tuple[float, float] = (0.0, 0.0),
    scale: float = 1.0,
    name: str = "seat",
    material: int | None = None,
    uv_set: int = 0,
) -> Mesh:
    """A mesh whose texture coordinates are its own x and y, scaled and then shifted."""
    uv = mesh.vertices[:, :2] * scale + np.array(shift)
    return Mesh(
        vertices=mesh.vertices,
        faces=mesh.faces,
        name=name,
        material=material,
        attributes={f"TEXCOORD_{uv_set}": Attribute(values=uv)},
    )


def laid_out(scene: Scene, **changes: object) -> Layout:
    settings = BakeSettings(**{"size": 64, **changes})  # type: ignore[arg-type]
    return lay_out(scene, build(scene, surfaces_of(scene, settings), settings), settings)


def corners_of(layout: Layout, instance: int) -> FloatArray:
    """(F, 3, 2) where the faces of an instance lie."""
    page = layout.pages[next(p.page for p in [layout.placings[instance]] if p is not None)]
    return page.corners[page.instances.index(instance)]


def test_a_set_without_overlaps_is_kept() -> None:
    layout = laid_out(Scene.from_meshes([textured()]))
    placing = layout.placings[0]
    assert placing is not None
    assert isinstance(placing.layout, Kept)
    assert placing.layout.uv_set == 0
    assert "TEXCOORD_0" in layout.pages[0].origin


def test_the_second_set_is_kept_where_the_first_one_overlaps() -> None:
    mesh = textured()
    both = {
        "TEXCOORD_0": Attribute(values=np.full((4, 2), 0.5)),
        "TEXCOORD_1": mesh.attributes["TEXCOORD_0"],
    }
    scene = Scene.from_meshes([Mesh(vertices=mesh.vertices, faces=mesh.faces, attributes=both)])
    placing = laid_out(scene).placings[0]
    assert placing is not None
    assert isinstance(placing.layout, Kept)
    assert placing.layout.uv_set == 1


@pytest.mark.parametrize("shift", [(0.5, 0.0), (0.0, 0.0)])
def test_meshes_that_share_an_image_and_overlap_on_it_are_unwrapped(
    shift: tuple[float, float],
) -> None:
    scene = Scene.from_meshes([textured(scale=0.5), textured(scale=0.5, shift=shift, name="back")])
    together = laid_out(scene)
    kept = [
        placing is not None and isinstance(placing.layout, Kept) for placing in together.placings
    ]
    assert kept == [shift[0] > 0.0] * 2
    assert len(together.pages) == 1


def test_each_mesh_keeps_its_set_on_an_image_of_its_own() -> None:
    scene = Scene.from_meshes([textured(), textured(name="back")])
    layout = laid_out(scene, atlas="mesh")
    assert [placing.page for placing in layout.placings if placing] == [0, 1]
    assert all(placing and isinstance(placing.layout, Kept) for placing in layout.placings)


def test_what_is_of_one_material_shares_an_image() -> None:
    parts = [
        textured(scale=0.4, material=0),
        textured(material=1),
        textured(scale=0.4, shift=(0.5, 0.5), material=0),
    ]
    scene = Scene(
        meshes=tuple(parts),
        instances=tuple(Instance(mesh=number) for number in range(3)),
        materials=(Material(), Material()),
    )
    layout = laid_out(scene, atlas="material")
    assert [placing.page for placing in layout.placings if placing] == [0, 1, 0]


def test_instances_of_one_mesh_get_places_of_their_own() -> None:
    away = affine(1.0, (5.0, 0.0, 0.0))
    scene = Scene(
        meshes=(textured(),), instances=(Instance(mesh=0), Instance(mesh=0, transform=away))
    )
    layout = laid_out(scene)
    first, second = (placing.layout for placing in layout.placings if placing)
    assert isinstance(first, Unwrapped)
    assert isinstance(second, Unwrapped)
    assert first.source is second.source
    assert first.faces is second.faces
    low, high = np.sort([corners_of(layout, i).reshape(-1, 2).min(axis=0) for i in (0, 1)], axis=0)
    assert (high - low).max() > 0.2


def test_instances_that_are_stored_together_share_their_place() -> None:
    scene = Scene(
        meshes=(textured(),),
        instances=(Instance(mesh=0, stored_with=0), Instance(mesh=0, stored_with=0)),
    )
    layout = laid_out(scene)
    assert layout.placings[0] is layout.placings[1]
    assert layout.pages[0].instances == (0,)
    assert layout.placings[0] is not None
    assert isinstance(layout.placings[0].layout, Kept)


def test_an_instance_of_three_times_the_size_gets_three_times_the_texels() -> None:
    large = np.diag([3.0, 3.0, 3.0, 1.0])
    scene = Scene(
        meshes=(textured(),), instances=(Instance(mesh=0), Instance(mesh=0, transform=large))
    )
    layout = laid_out(scene, size=256, uv="unwrap")
    small_size, large_size = (np.ptp(corners_of(layout, i).reshape(-1, 2), axis=0) for i in (0, 1))
    assert large_size / small_size == pytest.approx([3.0, 3.0], rel=1e-6)


def test_texels_per_unit_are_those_that_were_asked_for() -> None:
    layout = laid_out(Scene.from_meshes([textured()]), uv="unwrap", texels_per_unit=20.0)
    assert np.ptp(corners_of(layout, 0).reshape(-1, 2), axis=0) * 64 == pytest.approx([20.0, 20.0])


def test_what_has_no_area_and_what_stands_nowhere_gets_no_place() -> None:
    nowhere = np.full((4, 4), np.nan)
    line = Mesh(vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]], np.int32))
    scene = Scene(
        meshes=(line, textured()),
        instances=(Instance(mesh=0), Instance(mesh=1, transform=nowhere), Instance(mesh=1)),
    )
    layout = laid_out(scene)
    assert [placing is not None for placing in layout.placings] == [False, False, True]
    assert laid_out(Scene.from_meshes([line])).pages == ()


def test_keep_names_the_triangles_that_overlap() -> None:
    flat = Attribute(values=np.array([[0.0, 0.0], [1.0, 0.2], [1.0, 0.0], [1.0, 1.0]]))
    mesh = Mesh(
        vertices=SQUARE.vertices, faces=SQUARE.faces, name="seat", attributes={"TEXCOORD_0": flat}
    )
    with pytest.raises(InputError, match=r"TEXCOORD_0.*overlap.*'seat'.*--uv keep"):
        laid_out(Scene.from_meshes([mesh]), uv="keep")
    placing = laid_out(Scene.from_meshes([mesh])).placings[0]
    assert placing is not None
    assert isinstance(placing.layout, Unwrapped)


@pytest.mark.parametrize("uv", ["keep", "2"])
def test_a_set_that_is_missing_is_refused_where_it_was_asked_for(uv: str) -> None:
    mesh = mesh_of(SQUARE, name="seat")
    with pytest.raises(InputError, match=rf"'seat' has no TEXCOORD_{uv.replace('keep', '0')}"):
        laid_out(Scene.from_meshes([mesh]), uv=uv)


def test_an_image_that_is_too_small_is_refused_with_a_size_that_is_not() -> None:
    many = [textured(name=str(number)) for number in range(50)]
    with pytest.raises(InputError, match=r"\d+") as refused:
        laid_out(Scene.from_meshes(many), size=16, padding=4)
    assert "size" in str(refused.value)

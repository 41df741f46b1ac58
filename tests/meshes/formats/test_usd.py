"""USD: read as its library composes it, written as a layer over a file that stays as it is."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError
from aobake.meshes.formats import check_target, load, write_vertex_ao
from aobake.meshes.scene import Scene
from aobake.settings import Store, StoreSettings

pytest.importorskip("pxr", reason="usd-core is the extra usd")
from pxr import Usd, UsdGeom

HEAD = '#usda 1.0\n(\n    defaultPrim = "World"\n    upAxis = "Z"\n    metersPerUnit = 0.01\n)\n'
SQUARE = """
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
"""
RAMP = np.array([0.0, 0.25, 0.5, 1.0], np.float32)


def mesh(name: str, more: str = "", body: str = SQUARE) -> str:
    return f'    def Mesh "{name}"\n    {{\n        {body}\n        {more}\n    }}\n'


def world(*parts: str, more: str = "") -> str:
    return HEAD + 'def Xform "World"\n{\n' + more + "".join(parts) + "}\n"


def saved(folder: Path, text: str, name: str = "a.usda") -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def baked(
    source: Path, target: Path, *values: NDArray[np.float32], store: Store = "color"
) -> Scene:
    scene = load(source)
    ao = list(values) or [RAMP] * len(scene.instances)
    assert write_vertex_ao(scene, ao, target, StoreSettings(store=store)) == (target,)
    return scene


def primvar(path: Path, prim: str, name: str = "displayColor") -> tuple[NDArray[Any], str]:
    stage = Usd.Stage.Open(str(path))
    found = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(prim)).FindPrimvarWithInheritance(name)
    return np.array(found.ComputeFlattened()), str(found.GetInterpolation())


def corners(scene: Scene, number: int = 0) -> NDArray[np.float64]:
    """Where an instance's vertices stand."""
    instance, shape = list(scene.placed())[number]
    return shape.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3]


def test_polygons_are_read_with_holes_winding_and_place(tmp_path: Path) -> None:
    body = """
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 3, 0), (0, 2, 0), (9, 9, 9)]
        int[] faceVertexCounts = [5, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 0, 1, 5, 1, 2, 5]
        int[] holeIndices = [1]
        uniform token orientation = "leftHanded"
        uniform bool doubleSided = 1
        double3 xformOp:translate = (10, 0, 0)
        double3 xformOp:scale = (1, 1, 3)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    """
    scene = load(saved(tmp_path, world(mesh("house", body=body))))
    shape = scene.meshes[0]
    assert len(shape.faces) == 3 + 1
    a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals[:3, 2] < 0).all()  # the file's winding, seen from the left
    assert np.abs(normals[:3, 2]).sum() / 2 == pytest.approx(5.0)
    assert_array_equal(corners(scene)[5], [19.0, 9.0, 27.0])
    assert scene.materials[shape.material or 0].double_sided


@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying"])
def test_normals_are_those_of_the_file_but_not_of_a_subdivision_cage(
    tmp_path: Path, interpolation: str
) -> None:
    normals = f"""normal3f[] normals = [(0, 0, 2), (0, 0, 2), (0, 3, 4), (0, 0, 2)] (
            interpolation = "{interpolation}"
        )
        uniform token subdivisionScheme = """
    shape = load(saved(tmp_path, world(mesh("m", normals + '"none"')))).meshes[0]
    assert shape.normals is not None
    unit = shape.normals / np.linalg.norm(shape.normals, axis=1, keepdims=True)
    assert_allclose(unit, np.array([[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8], [0, 0, 1]]))
    caged = load(saved(tmp_path, world(mesh("m", normals + '"catmullClark"'))))
    assert caged.meshes[0].normals is None


def test_what_is_not_seen_is_passed_over(tmp_path: Path) -> None:
    hidden = '    def Xform "off"\n    {\n token visibility = "invisible"\n' + mesh("a") + "    }\n"
    guide = mesh("b", 'uniform token purpose = "guide"')
    unloaded = mesh("c").replace("def", "class")
    scene = load(saved(tmp_path, world(hidden, guide, unloaded, mesh("seen"))))
    assert [instance.name for instance in scene.instances] == ["seen"]


def test_the_layer_leaves_the_file_below_as_it_is_and_says_what_its_root_said(
    tmp_path: Path,
) -> None:
    source = saved(tmp_path, world(mesh("m"), mesh("n"), more="    custom string note = 'x'\n"))
    kept = source.read_bytes()
    other = RAMP[::-1].copy()
    baked(source, tmp_path / "b.usda", RAMP, other)
    assert source.read_bytes() == kept
    stage = Usd.Stage.Open(str(tmp_path / "b.usda"))
    assert stage.GetRootLayer().subLayerPaths[:] == ["./a.usda"]
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert str(stage.GetDefaultPrim().GetPath()) == "/World"
    assert stage.GetDefaultPrim().GetAttribute("note").Get() == "x"
    for name, values in (("m", RAMP), ("n", other)):
        found, interpolation = primvar(tmp_path / "b.usda", f"/World/{name}")
        assert interpolation == "vertex"
        assert_array_equal(found, np.repeat(values[:, None], 3, axis=1))


TWO_FACES = """
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
"""
R, G = [1.0, 0.5, 0.0], [0.0, 1.0, 0.25]


@pytest.mark.parametrize(
    ("values", "interpolation", "expected"),
    [
        ("[(1, .5, 0)]", "constant", [R, R, R, R]),
        ("[(1, .5, 0), (0, 1, .25), (1, .5, 0), (0, 1, .25)]", "vertex", [R, G, R, G]),
        ("[(1, .5, 0), (0, 1, .25)]", "uniform", [R, R, R, G, G, G]),
        (
            "[(1, .5, 0), (0, 1, .25), (1, .5, 0), (0, 1, .25), (1, .5, 0), (0, 1, .25)]",
            "faceVarying",
            [R, G, R, G, R, G],
        ),
    ],
)
@pytest.mark.parametrize("indexed", [False, True])
def test_colours_of_every_kind_are_multiplied(
    tmp_path: Path, values: str, interpolation: str, expected: list[list[float]], indexed: bool
) -> None:
    count = values.count("(")
    color = f'color3f[] primvars:displayColor = {values} ( interpolation = "{interpolation}" )\n'
    if indexed:
        color += f"int[] primvars:displayColor:indices = {list(range(count))}\n"
    source = saved(tmp_path, world(mesh("m", color, TWO_FACES)))
    baked(source, tmp_path / "b.usda")
    found, kind = primvar(tmp_path / "b.usda", "/World/m")
    by_corner = interpolation in {"uniform", "faceVarying"}
    assert kind == ("faceVarying" if by_corner else "vertex")
    factors = RAMP[[0, 1, 2, 0, 2, 3]] if by_corner else RAMP
    assert_allclose(found, np.array(expected) * factors[:, None], atol=1e-7)


def test_a_colour_that_is_inherited_is_multiplied_too(tmp_path: Path) -> None:
    color = "    color3f[] primvars:displayColor = [(1, .5, 0)]\n"
    baked(saved(tmp_path, world(mesh("m"), more=color)), tmp_path / "b.usda")
    found, _ = primvar(tmp_path / "b.usda", "/World/m")
    assert_allclose(found, RAMP[:, None] * np.array(R), atol=1e-7)


def test_instances_get_values_of_their_own_and_stay_where_they_were(tmp_path: Path) -> None:
    def instance(name: str, x: int) -> str:
        return (
            f'    def Xform "{name}" ( instanceable = true\n references = </Proto> )\n    {{\n'
            f"        double3 xformOp:translate = ({x}, 0, 0)\n"
            '        uniform token[] xformOpOrder = ["xformOp:translate"]\n    }\n'
        )

    proto = 'class Xform "Proto"\n{\n' + mesh("m") + "}\n"
    source = saved(tmp_path, world(instance("i", 1), instance("j", 5)) + proto)
    scene = baked(source, tmp_path / "b.usda", RAMP, np.ones(4, np.float32))
    assert [corners(scene, k)[0, 0] for k in (0, 1)] == [1.0, 5.0]
    for name, values in (("i", RAMP), ("j", np.ones(4))):
        found, _ = primvar(tmp_path / "b.usda", f"/World/{name}/m")
        assert_array_equal(found[:, 0], values)
    again = load(tmp_path / "b.usda")
    assert_array_equal(corners(again, 1), corners(scene, 1))


INSTANCER = """    def PointInstancer "many"
    {
        rel prototypes = [</World/many/square>, </World/many/other>]
        int[] protoIndices = [0, 1, 0, 0]
        point3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 0, 7), (1, 1, 1)]
        int64[] invisibleIds = [3]
        double3 xformOp:translate = (0, 100, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
%s%s    }
"""


def test_point_instances_share_the_mean_of_their_values(tmp_path: Path) -> None:
    moved = "double3 xformOp:scale = (2, 2, 2)\n uniform token[] xformOpOrder = ['xformOp:scale']"
    text = world(INSTANCER % (mesh("square", moved), mesh("other")))
    source = saved(tmp_path, text)
    scene = load(source)
    assert [instance.name for instance in scene.instances] == ["square", "square", "other"]
    assert_array_equal(corners(scene, 1)[2], [2.0, 102.0, 7.0])
    assert_array_equal(corners(scene, 2)[2], [6.0, 101.0, 0.0])
    found = check_target(scene, tmp_path / "b.usda", StoreSettings())
    assert len(found) == 1
    assert "1 instances of point instancers share" in found[0]
    baked(source, tmp_path / "b.usda", RAMP, np.ones(4, np.float32), np.zeros(4, np.float32))
    values, _ = primvar(tmp_path / "b.usda", "/World/many/square")
    assert_allclose(values[:, 0], (RAMP + 1) / 2)
    assert not primvar(tmp_path / "b.usda", "/World/many/other")[0].any()


@pytest.mark.parametrize("store", ["attribute", "occlusion"])
def test_apart_from_the_colours_it_is_a_primvar_of_its_own(tmp_path: Path, store: Store) -> None:
    source = saved(tmp_path, world(mesh("m")))
    said = check_target(load(source), tmp_path / "b.usda", StoreSettings(store=store))
    assert len(said) == (store == "occlusion")
    baked(source, tmp_path / "b.usda", store=store)
    found, interpolation = primvar(tmp_path / "b.usda", "/World/m", "ao")
    assert_array_equal(found, RAMP)
    assert interpolation == "vertex"


@pytest.mark.parametrize("suffix", [".usda", ".usd", ".usdc"])
@pytest.mark.parametrize("package", [False, True])
def test_every_kind_of_layer_goes_over_every_kind_of_file(
    tmp_path: Path, suffix: str, package: bool
) -> None:
    source = saved(tmp_path, world(mesh("m")))
    if package:
        with zipfile.ZipFile(tmp_path / "p.usdz", "w") as archive:
            name, align = "a.usda", 64
            info = zipfile.ZipInfo(name)
            pad = (-(30 + len(name) + 4)) % align
            info.extra = b"\x86\x19" + pad.to_bytes(2, "little") + bytes(pad)
            archive.writestr(info, source.read_bytes())
        source.unlink()
        source = tmp_path / "p.usdz"
    (tmp_path / "out folder").mkdir()
    target = tmp_path / "out folder" / f"b{suffix}"
    baked(source, target)
    assert_array_equal(primvar(target, "/World/m")[0][:, 0], RAMP)
    assert target.read_bytes().startswith(b"PXR-USDC" if suffix == ".usdc" else b"#usda")
    again = load(target, root=tmp_path)
    said = check_target(again, tmp_path / "c.usda", StoreSettings())
    assert len(said) == 1
    assert "earlier bake" in said[0]


def test_layers_outside_of_the_folder_need_leave(tmp_path: Path) -> None:
    saved(tmp_path, world(mesh("m")), "a.usda")
    over = saved(tmp_path, "#usda 1.0\n(\n    subLayers = [@../a.usda@]\n)\n", "in/b.usda")
    with pytest.raises(InputError, match=r"outside of its folder.*--root"):
        load(over)
    scene = load(over, root=tmp_path)
    assert scene.source is not None
    assert [file.name for file in scene.source.files] == ["b.usda", "a.usda"]


def test_a_layer_that_is_missing_is_told_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lost = '    def "lost" ( references = [@nowhere.usda@, @https://example.com/b.usda@] )\n    {\n    }\n'
    scene = load(saved(tmp_path, world(mesh("m"), lost)))
    assert any("nowhere.usda" in text for text in scene.warnings)
    assert all(text.startswith("a.usda: ") and "\n" not in text for text in scene.warnings)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ('#usda 1.0\ndef Mesh "m" {', "cannot be read as USD"),
        (world(mesh("m", body=SQUARE.replace("[4]", "[5]"))), "ask for 5 corners, and there are 4"),
        (world(mesh("m", body=SQUARE.replace("2, 3]", "2, 4]"))), "corner 3 points at vertex 4"),
        (world(mesh("m", body=SQUARE.replace("2, 3]", "2, -1]"))), "points at vertex -1"),
        ("", "the file is empty"),
        (world(), "no triangle"),
        (
            world((INSTANCER % (mesh("square"), mesh("other"))).replace(", (1, 1, 1)]", "]")),
            "4 instances and places for",
        ),
    ],
)  # fmt: skip
def test_a_broken_file_is_one_line(
    tmp_path: Path, text: str, finding: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match=finding) as caught:
        load(saved(tmp_path, text))
    assert "a.usda" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_layer_cannot_replace_what_it_lies_over(tmp_path: Path) -> None:
    source = saved(tmp_path, world(mesh("m")))
    with pytest.raises(OutputError, match="a layer over this very file"):
        check_target(load(source), source, StoreSettings())
    with pytest.raises(OutputError, match=r"-o NAME\.usda"):
        check_target(load(source), tmp_path / "b.usdz", StoreSettings())
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(OutputError, match=r"read from none.*-o NAME\.glb"):
        check_target(load(tmp_path / "a.obj"), tmp_path / "b.usda", StoreSettings())


def test_a_usd_scene_is_written_as_glb(tmp_path: Path) -> None:
    write_vertex_ao(
        load(saved(tmp_path, world(mesh("m")))), [RAMP], tmp_path / "a.glb", StoreSettings()
    )
    assert_array_equal(load(tmp_path / "a.glb").meshes[0].vertices[2], [1, 1, 0])


def test_without_the_package_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"usd-core.*pip install \"aobake\[usd\]\""):
        load(saved(tmp_path, world(mesh("m"))))

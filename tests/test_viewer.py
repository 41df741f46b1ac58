"""The page that shows an asset: whole, closed to the network, and the same asset that was put in."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html
import json
import re
import shutil
import struct
import subprocess
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aobake
from aobake.errors import OutputError
from aobake.images import decode, encode
from aobake.meshes.materials import Image, Texture
from aobake.meshes.scene import Attribute
from aobake.viewer import packed_glb, page_of
from aobake.viewer import page as page_module
from tests.support import ROOT

FOLDER = files("aobake.viewer")
LOADS = {"src", "href", "srcset", "action", "data", "poster", "background"}  # attributes that fetch


class Page(HTMLParser):
    """What a browser would find in a page: tags with their attributes, and the texts of its scripts and styles."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.scripts: list[str] = []
        self._inside = ""
        self.feed(page.decode("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        found = dict(attrs)
        self._inside = found.get("id") or tag
        if tag == "script" and not found.get("type"):
            self.scripts.append("")
            self._inside = "code"

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002 - the parser calls it so
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "code":
            self.scripts[-1] += data
        elif self._inside:
            self.texts[self._inside] = self.texts.get(self._inside, "") + data

    def policy(self) -> str:
        meta = [attrs for tag, attrs in self.tags if tag == "meta"]
        return next(
            a["content"] or "" for a in meta if a.get("http-equiv", "") == "Content-Security-Policy"
        )

    def asset(self) -> bytes:
        return base64.b64decode(self.texts["asset"], validate=True)


def glb(text: dict[str, object], binary: bytes = b"") -> bytes:
    body = json.dumps(text).encode()
    body += b" " * (-len(body) % 4)
    chunks = struct.pack("<I4s", len(body), b"JSON") + body
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def opened(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON and the BIN chunk of a GLB."""
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def view_bytes(text: dict[str, Any], binary: bytes, number: int) -> bytes:
    view = text["bufferViews"][number]
    assert view["buffer"] == 0
    begin = view.get("byteOffset", 0)
    return binary[begin : begin + view["byteLength"]]


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
PNG = encode(np.full((2, 2, 3), 0.5, np.float32), "png")


def write_scattered(folder: Path) -> Path:
    """A .gltf of a side file, a data URI, an image beside it and one that is missing."""
    (folder / "a b.bin").write_bytes(TRIANGLE + b"\0" * 3)
    (folder / "skin.png").write_bytes(PNG)
    indices = base64.b64encode(b"\0\0" + np.array([0, 1, 2], "<u2").tobytes()).decode()
    text = {
        "asset": {"version": "2.0"},
        "extras": {"kept": [1, 2]},
        "buffers": [
            {"uri": "a%20b.bin", "byteLength": 36},
            {"uri": f"data:application/octet-stream;base64,{indices}", "byteLength": 8},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 1, "byteOffset": 2, "byteLength": 6},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "images": [{"uri": "skin.png"}, {"uri": "gone.png"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"children": [1]}, {"mesh": 0}],
    }
    path = folder / "scattered.gltf"
    path.write_text(json.dumps(text), encoding="utf-8")
    return path


def test_a_page_asks_the_network_for_nothing(corner: Path) -> None:
    page = Page(page_of(packed_glb(aobake.load(corner)).glb, "corner"))
    assert {name for _, attrs in page.tags for name in attrs} & LOADS == set()
    assert {tag for tag, _ in page.tags} & {"link", "iframe", "base", "img", "form"} == set()
    assert "url(" not in page.texts["style"]
    assert "@import" not in page.texts["style"]
    policy = page.policy()
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy
    assert "'unsafe-inline'" not in policy
    assert "connect-src" not in policy, "so that default-src holds"


def test_its_policy_allows_its_own_scripts_and_style_and_no_others() -> None:
    page = Page(page_of(glb({}), "x"))
    allowed = re.findall(r"'sha256-([^']+)'", page.policy())
    own = [*page.scripts, page.texts["style"]]
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in own]
    assert allowed == hashes
    assert len(page.scripts) == 1


@pytest.mark.parametrize(
    "name",
    ["<script>alert(1)</script>", "\"a\" & 'b'.glb", "$asset ${name}", "\udcff.glb", "木 ü"],
)
def test_the_name_of_an_asset_is_a_text_and_nothing_else(name: str) -> None:
    page = Page(page_of(glb({}), name, [name]))
    shown = name.encode("utf-8", "replace").decode()
    assert page.texts["title"] == shown
    assert page.texts["h1"] == shown
    assert page.texts["facts"] == shown
    assert len(page.scripts) == 1


def test_the_decoder_of_draco_comes_with_assets_that_need_it() -> None:
    plain = page_of(glb({}), "x")
    draco = page_of(glb({"extensionsUsed": ["KHR_draco_mesh_compression"]}), "x")
    assert len(Page(draco).scripts) == 2
    assert len(draco) > len(plain) + 200_000
    assert len(draco) < 1_300_000
    assert "Apache License" in Page(draco).texts["licences"]
    assert "three 0." in Page(plain).texts["licences"]


def test_the_asset_comes_out_as_it_went_in() -> None:
    data = glb({"asset": {"version": "2.0"}}, bytes(range(256)))
    assert Page(page_of(data, "x")).asset() == data


def test_an_asset_too_large_for_a_browser_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_module, "MOST_BYTES", 1 << 20)
    with pytest.raises(OutputError, match=r"big\.glb: it takes 2 MiB"):
        page_of(glb({}, bytes(2 << 20)), "big.glb")


def test_a_scattered_gltf_becomes_one_file_and_loses_nothing(tmp_path: Path) -> None:
    packed = packed_glb(aobake.load(write_scattered(tmp_path)))
    text, binary = opened(packed.glb)
    assert "uri" not in json.dumps(text)
    assert text["buffers"] == [{"byteLength": len(binary)}]
    assert view_bytes(text, binary, 0) == TRIANGLE
    assert view_bytes(text, binary, 1) == np.array([0, 1, 2], "<u2").tobytes()
    assert text["images"][0]["mimeType"] == "image/png"
    assert view_bytes(text, binary, text["images"][0]["bufferView"]) == PNG
    assert text["extras"] == {"kept": [1, 2]}
    assert text["scenes"][text["scene"]] == {"nodes": [0]}, "roots alone"
    assert len(packed.warnings) == 1
    assert "gone.png" in packed.warnings[0]


def test_compressed_views_are_turned_to_where_their_bytes_are(tmp_path: Path) -> None:
    """The placeholder of what meshopt has compressed has no bytes, and stays one."""
    path = write_scattered(tmp_path)
    text = json.loads(path.read_text(encoding="utf-8"))
    text["buffers"].append(
        {"byteLength": 64, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    )
    compressed = {"buffer": 1, "byteOffset": 2, "byteLength": 6, "byteStride": 2, "count": 3}
    text["bufferViews"].append(
        {
            "buffer": 2,
            "byteLength": 64,
            "extensions": {"EXT_meshopt_compression": {**compressed, "mode": "TRIANGLES"}},
        }
    )
    path.write_text(json.dumps(text), encoding="utf-8")
    text, binary = opened(packed_glb(aobake.load(path)).glb)
    view = text["bufferViews"][2]
    within = view["extensions"]["EXT_meshopt_compression"]
    assert text["buffers"][view["buffer"]]["byteLength"] == 64
    assert within["buffer"] == 0
    begin = within["byteOffset"]
    assert binary[begin : begin + 6] == np.array([0, 1, 2], "<u2").tobytes()


def test_the_scene_that_was_chosen_is_shown(tmp_path: Path) -> None:
    path = write_scattered(tmp_path)
    text = json.loads(path.read_text(encoding="utf-8"))
    text["scenes"] = [{"nodes": [0]}, {"nodes": [1], "name": "second"}]
    path.write_text(json.dumps(text), encoding="utf-8")
    assert opened(packed_glb(aobake.load(path)).glb)[0]["scene"] == 0
    assert opened(packed_glb(aobake.load(path, scene="second")).glb)[0]["scene"] == 1


def test_the_pose_that_was_chosen_is_shown(tmp_path: Path) -> None:
    path = write_scattered(tmp_path)
    text = json.loads(path.read_text(encoding="utf-8"))
    keys = np.array([0, 2, 0, 0, 0, 4, 0, 8], "<f4").tobytes()  # two times, two translations
    text["buffers"].append(
        {"uri": f"data:;base64,{base64.b64encode(keys).decode()}", "byteLength": len(keys)}
    )
    text["bufferViews"].append({"buffer": 2, "byteLength": len(keys)})
    float32 = {"bufferView": 2, "componentType": 5126, "count": 2}
    text["accessors"] += [
        {**float32, "type": "SCALAR", "min": [0], "max": [2]},
        {**float32, "byteOffset": 8, "type": "VEC3"},
    ]
    target = {"node": 1, "path": "translation"}
    clip = {"channels": [{"sampler": 0, "target": target}], "samplers": [{"input": 2, "output": 3}]}
    text["animations"] = [clip]
    path.write_text(json.dumps(text), encoding="utf-8")
    packed = packed_glb(aobake.load(path, pose="0@1"), "0@1")
    assert opened(packed.glb)[0]["nodes"][1] == {"mesh": 0, "translation": [2.0, 0.0, 4.0]}
    assert "translation" not in opened(packed_glb(aobake.load(path)).glb)[0]["nodes"][1]


def square(**more: Any) -> aobake.Mesh:
    """Two triangles in a plane."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    return aobake.Mesh(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32), **more)


def read_back(scene: aobake.Scene, tmp_path: Path) -> aobake.Scene:
    path = tmp_path / "packed.glb"
    path.write_bytes(packed_glb(scene).glb)
    return aobake.load(path)


def test_occlusion_and_corner_values_of_other_formats_come_along(tmp_path: Path) -> None:
    uv = Attribute(
        values=np.arange(12, dtype=np.float64).reshape(6, 2) / 16,
        corners=np.arange(6, dtype=np.int32).reshape(2, 3),
    )
    ao = Attribute(values=np.array([[0.25], [0.5], [0.75], [1.0]]))
    scene = aobake.Scene.from_meshes([square(attributes={"TEXCOORD_0": uv, "_AO": ao})])
    mesh = read_back(scene, tmp_path).meshes[0]
    for name in ("TEXCOORD_0", "_AO"):
        before, after = scene.meshes[0].at_corners(name), mesh.at_corners(name)
        assert before is not None
        assert after is not None
        np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(
        mesh.vertices[mesh.faces], scene.meshes[0].vertices[scene.meshes[0].faces]
    )


def test_creases_of_meshes_without_normals_stay_sharp(tmp_path: Path) -> None:
    fold = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]], np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3]], np.int32)
    mesh = read_back(aobake.Scene.from_arrays(fold, faces), tmp_path).meshes[0]
    assert mesh.normals is not None
    assert len(mesh.vertices) == 6
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    facets = np.cross(b - a, c - a)
    np.testing.assert_allclose(mesh.normals[mesh.faces], np.repeat(facets[:, None], 3, axis=1))
    flat = read_back(aobake.Scene.from_meshes([square()]), tmp_path).meshes[0]
    assert len(flat.vertices) == 4, "nothing to split in a plane"


def test_textures_of_other_formats_come_along(tmp_path: Path) -> None:
    turn = np.array([[0.0, 3.0, 0.25], [-2.0, 0.0, 0.5]])
    texture = Texture(image=0, transform=turn, wrap=("clamp", "mirror"), nearest=True)
    tiff = encode(np.full((2, 2, 1), 0.25, np.float32), "tiff")
    material = aobake.Material(
        base_color_texture=texture,
        occlusion_texture=Texture(image=1),
        occlusion_strength=0.5,
        emissive_texture=Texture(image=2),
        emissive=(0.0, 2.0, 0.5),
    )

    def gone() -> bytes:
        raise aobake.InputError("gone.png: there is no such file.")

    uv = Attribute(values=np.zeros((4, 2)))
    scene = dataclasses.replace(
        aobake.Scene.from_meshes([square(attributes={"TEXCOORD_0": uv})]), materials=(material,)
    )
    images = tuple(
        Image(name=name, data=data)
        for name, data in (("a.png", lambda: PNG), ("b.tif", lambda: tiff), ("c.png", gone))
    )
    scene = dataclasses.replace(
        scene,
        images=images,
        meshes=(dataclasses.replace(scene.meshes[0], material=0),),
    )
    packed = packed_glb(scene)
    assert packed.warnings == ("gone.png: there is no such file.",)
    found = read_back(scene, tmp_path)
    shown = found.materials[0]
    assert shown.emissive == (0.0, 1.0, 0.5)
    assert shown.emissive_texture is None
    assert shown.occlusion_strength == 0.5
    assert shown.occlusion_texture is not None
    converted = decode(found.images[shown.occlusion_texture.image].data(), "x.png")
    np.testing.assert_allclose(converted, 0.25, atol=0.003)
    assert shown.base_color_texture is not None
    assert shown.base_color_texture.wrap == ("clamp", "mirror")
    assert shown.base_color_texture.nearest
    assert shown.base_color_texture.transform is not None
    np.testing.assert_allclose(shown.base_color_texture.transform, turn, atol=1e-12)
    assert found.images[shown.base_color_texture.image].data() == PNG


def test_vendored_files_are_those_that_were_built() -> None:
    vendor = FOLDER / "vendor"
    manifest = json.loads((vendor / "manifest.json").read_text(encoding="utf-8"))
    found = {path.name for path in vendor.iterdir()} - {"manifest.json"}
    assert found == manifest["files"].keys()
    for name, digest in manifest["files"].items():
        assert hashlib.sha256((vendor / name).read_bytes()).hexdigest() == digest, name


def test_vendored_files_are_of_the_versions_that_are_pinned() -> None:
    manifest = json.loads((FOLDER / "vendor" / "manifest.json").read_text(encoding="utf-8"))
    wanted = json.loads((ROOT / "viewer" / "package.json").read_text(encoding="utf-8"))
    locked = json.loads((ROOT / "viewer" / "package-lock.json").read_text(encoding="utf-8"))
    assert manifest["packages"].items() <= wanted["devDependencies"].items()
    for name, version in wanted["devDependencies"].items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version), f"{name} is not pinned"
        entry = locked["packages"][f"node_modules/{name}"]
        assert entry["version"] == version
        assert entry["integrity"].startswith("sha512-")


@pytest.mark.parametrize("name", ["viewer.min.js", "draco.min.js"])
def test_vendored_scripts_cannot_end_the_element_that_holds_them(name: str) -> None:
    text = (FOLDER / "vendor" / name).read_bytes()
    assert text.isascii()
    assert b"</script" not in text.lower()
    assert b"<!--" not in text
    assert b"eval(" not in text.replace(b"wasm-unsafe-eval", b"")


CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_without_a_network_shows_the_asset_and_where_its_occlusion_is(
    corner: Path, tmp_path: Path
) -> None:
    scene = aobake.load(corner)
    baked = aobake.bake_vertices(scene, aobake.BakeSettings(rays=16))
    aobake.save(baked, tmp_path / "corner.glb")
    path = tmp_path / "corner.html"
    path.write_bytes(page_of(packed_glb(aobake.load(tmp_path / "corner.glb")).glb, "corner"))
    done = subprocess.run(
        [
            *(str(CHROMIUM), "--headless", "--no-sandbox", "--no-first-run", "--dump-dom"),
            *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
            *("--proxy-server=127.0.0.1:9", f"--user-data-dir={tmp_path / 'profile'}"),
            *("--virtual-time-budget=20000", "--window-size=320,240"),
            f"{path.as_uri()}#alone",
        ],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    tag = re.search(r"<html[^>]*>", done.stdout)
    assert tag, done.stderr[-2000:]
    assert 'data-state="ready"' in tag[0], html.unescape(done.stdout)[-500:]
    assert "ambient occlusion in vertex colours" in done.stdout

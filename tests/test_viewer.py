"""The page that shows an asset: whole, closed to the network, and the same asset that was put in."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aobake
from aobake.errors import OutputError
from aobake.images import encode
from aobake.viewer import packed_glb, page_of
from aobake.viewer import page as page_module
from tests.browser import CHROMIUM
from tests.meshes.formats.gltf.build import pack_glb, unpack_glb

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
    page = Page(page_of(pack_glb({}), "x"))
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
    page = Page(page_of(pack_glb({}), name, [name]))
    shown = name.encode("utf-8", "replace").decode()
    assert page.texts["title"] == shown
    assert page.texts["h1"] == shown
    assert page.texts["facts"] == shown
    assert len(page.scripts) == 1


def test_the_decoder_of_draco_comes_with_assets_that_need_it() -> None:
    plain = page_of(pack_glb({}), "x")
    draco = page_of(pack_glb({"extensionsUsed": ["KHR_draco_mesh_compression"]}), "x")
    assert len(Page(draco).scripts) == 2
    assert len(draco) > len(plain) + 200_000
    assert len(draco) < 1_300_000
    assert "Apache License" in Page(draco).texts["licences"]
    assert "three 0." in Page(plain).texts["licences"]


def test_the_asset_comes_out_as_it_went_in() -> None:
    data = pack_glb({"asset": {"version": "2.0"}}, bytes(range(256)))
    assert Page(page_of(data, "x")).asset() == data


def test_an_asset_too_large_for_a_browser_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_module, "MOST_BYTES", 1 << 20)
    with pytest.raises(OutputError, match=r"big\.glb: it takes 2 MiB"):
        page_of(pack_glb({}, bytes(2 << 20)), "big.glb")


def test_a_scattered_gltf_becomes_one_file_and_loses_nothing(tmp_path: Path) -> None:
    packed = packed_glb(aobake.load(write_scattered(tmp_path)))
    text, binary, _ = unpack_glb(packed.glb)
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
    text, binary, _ = unpack_glb(packed_glb(aobake.load(path)).glb)
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
    assert unpack_glb(packed_glb(aobake.load(path)).glb)[0]["scene"] == 0
    assert unpack_glb(packed_glb(aobake.load(path, scene="second")).glb)[0]["scene"] == 1


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
    assert unpack_glb(packed.glb)[0]["nodes"][1] == {"mesh": 0, "translation": [2.0, 0.0, 4.0]}
    assert "translation" not in unpack_glb(packed_glb(aobake.load(path)).glb)[0]["nodes"][1]


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

"""Side files: found whatever their names, never fetched, never outside of the folder, copied where they are needed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from aobake.errors import InputError, OutputError
from aobake.meshes.formats import gltf
from aobake.settings import StoreSettings
from tests.meshes.formats.gltf.build import SQUARE, bake, load, ramp, square_builder


def with_file(folder: Path, name: str, uri: str) -> Path:
    """A square whose buffer is the file `name`, called `uri`."""
    folder.mkdir(parents=True, exist_ok=True)
    builder = square_builder()
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(builder.data)
    return builder.gltf(folder / "a.gltf", uri=uri)


@pytest.mark.parametrize(
    ("name", "uri"),
    [
        ("plain.bin", "plain.bin"),
        ("with space.bin", "with%20space.bin"),
        ("with space.bin", "with space.bin"),
        ("100%25.bin", "100%25.bin"),
        ("qu'ote#1.bin", "qu'ote%231.bin"),
        ("Stühle-椅子.bin", "Stühle-椅子.bin"),
        ("Stühle-椅子.bin", "St%C3%BChle-%E6%A4%85%E5%AD%90.bin"),
        ("sub/folder/b.bin", "sub/folder/b.bin"),
        ("sub/b.bin", "sub\\b.bin"),
        ("b.bin", "./sub/../b.bin"),
    ],
)
def test_a_side_file_is_found_and_copied_by_its_name(tmp_path: Path, name: str, uri: str) -> None:
    (tmp_path / "in" / "sub").mkdir(parents=True)
    path = with_file(tmp_path / "in", name, uri)
    out = tmp_path / "out"
    out.mkdir()
    scene = bake(path, out / "b.gltf")
    np.testing.assert_array_equal(scene.meshes[0].vertices, SQUARE)
    np.testing.assert_array_equal(load(out / "b.gltf").meshes[0].vertices, SQUARE)
    assert json.loads((out / "b.gltf").read_text(encoding="utf-8"))["buffers"][0]["uri"] == uri
    assert scene.source is not None
    assert len(scene.source.files) == 2


@pytest.mark.parametrize(
    "uri",
    [
        "http://host/a.bin",
        "HTTPS://host/a.bin",
        "file:///etc/passwd",
        "//host/a.bin",
        "\\\\host\\a.bin",
    ],
)
def test_what_lies_elsewhere_is_never_fetched(tmp_path: Path, uri: str) -> None:
    with pytest.raises(InputError, match=r"lies elsewhere.*nothing is fetched"):
        load(square_builder().gltf(tmp_path / "a.gltf", uri=uri))


@pytest.mark.parametrize("way", ["..", "percent", "absolute", "link"])
def test_a_buffer_outside_of_the_folder_needs_a_root(tmp_path: Path, way: str) -> None:
    folder = tmp_path / "asset"
    outside = tmp_path / "shared" / "b.bin"
    outside.parent.mkdir()
    outside.write_bytes(square_builder().data)
    uri = {
        "..": "../shared/b.bin",
        "percent": "%2e%2e/shared/b.bin",
        "absolute": str(outside),
        "link": "link.bin",
    }[way]
    path = with_file(folder, "unused.bin", uri)
    if way == "link":
        (folder / "link.bin").symlink_to(outside)
    with pytest.raises(InputError, match=r"leaves the folder of the asset.*--root"):
        load(path)
    assert load(path, root=tmp_path).triangles == 2


def test_an_image_outside_or_missing_or_elsewhere_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(b"secret")
    builder = square_builder()
    uris = [
        "../secret.png",
        "missing.png",
        "https://host/x.png",
        "a\0b.png",
        "x" * 5000,
        "data:image/png;base64,!!",
    ]
    builder.json["images"] = [{"uri": uri} for uri in uris]
    (tmp_path / "in").mkdir()
    path = builder.glb(tmp_path / "in" / "a.glb")
    (tmp_path / "deep" / "out").mkdir(parents=True)
    bake(path, tmp_path / "deep" / "out" / "b.glb")
    assert [p.name for p in tmp_path.rglob("*.png")] == ["secret.png"]
    assert sorted(p.name for p in (tmp_path / "deep").rglob("*")) == ["b.glb", "out"]


def test_files_named_in_extensions_are_copied_too(tmp_path: Path) -> None:
    (tmp_path / "in" / "lights").mkdir(parents=True)
    (tmp_path / "in" / "lights" / "a.ies").write_bytes(b"IES")
    builder = square_builder()
    builder.json["extensions"] = {"EXT_lights_ies": {"lights": [{"uri": "lights/a.ies"}]}}
    (tmp_path / "out").mkdir()
    bake(builder.glb(tmp_path / "in" / "a.glb"), tmp_path / "out" / "a.glb")
    assert (tmp_path / "out" / "lights" / "a.ies").read_bytes() == b"IES"


def test_another_file_of_the_same_name_is_not_overwritten(tmp_path: Path) -> None:
    path = with_file(tmp_path / "in", "b.bin", "b.bin")
    out = tmp_path / "out"
    out.mkdir()
    (out / "b.bin").write_bytes(b"of another asset")
    with pytest.raises(OutputError, match=r"b\.bin: another file of this name is there"):
        bake(path, out / "a.gltf")
    assert [p.name for p in out.iterdir()] == ["b.bin"]
    assert (out / "b.bin").read_bytes() == b"of another asset"


def test_a_second_bake_replaces_what_the_first_one_wrote(tmp_path: Path) -> None:
    path = with_file(tmp_path / "in", "b.bin", "b.bin")
    out = tmp_path / "out"
    out.mkdir()
    bake(path, out / "a.gltf")
    changed = bytes(square_builder().data).replace(np.float32(1).tobytes(), np.float32(2).tobytes())
    (tmp_path / "in" / "b.bin").write_bytes(changed)
    bake(path, out / "a.gltf")
    assert sorted(p.name for p in out.iterdir()) == ["a.gltf", "a_ao.bin", "b.bin"]
    np.testing.assert_array_equal(load(out / "a.gltf").meshes[0].vertices, 2 * np.array(SQUARE))


def test_a_new_buffer_never_takes_the_name_of_another_file(tmp_path: Path) -> None:
    path = with_file(tmp_path, "b.bin", "b.bin")
    (tmp_path / "c_ao.bin").write_bytes(b"mine")
    bake(path, tmp_path / "c.gltf")
    assert (tmp_path / "c_ao.bin").read_bytes() == b"mine"
    assert (tmp_path / "c_ao2.bin").exists()


def test_a_bake_of_a_bake_onto_itself_keeps_the_buffer_that_it_reads(tmp_path: Path) -> None:
    path = with_file(tmp_path, "b.bin", "b.bin")
    bake(path, tmp_path / "c.gltf", ao=[np.full(4, 0.5, np.float32)])
    bake(tmp_path / "c.gltf", tmp_path / "c.gltf", ao=[np.full(4, 0.5, np.float32)])
    scene = load(tmp_path / "c.gltf")
    np.testing.assert_array_equal(scene.meshes[0].vertices, SQUARE)
    buffers = json.loads((tmp_path / "c.gltf").read_text())["buffers"]
    assert [buffer["uri"] for buffer in buffers] == ["b.bin", "c_ao.bin", "c_ao2.bin"]


def test_a_side_file_outside_is_not_written_anywhere(tmp_path: Path) -> None:
    path = with_file(tmp_path / "in", "unused.bin", "../b.bin")
    (tmp_path / "b.bin").write_bytes(square_builder().data)
    (tmp_path / "deep" / "out").mkdir(parents=True)
    with pytest.raises(OutputError, match="outside of its folder"):
        bake(path, tmp_path / "deep" / "out" / "a.gltf", root=tmp_path)
    assert list((tmp_path / "deep").rglob("*")) == [tmp_path / "deep" / "out"]
    bake(path, tmp_path / "deep" / "a.gltf", root=tmp_path) if (
        tmp_path / "deep" / "b.bin"
    ).exists() else None
    (tmp_path / "beside").mkdir()
    bake(path, tmp_path / "beside" / "a.gltf", root=tmp_path)
    assert load(tmp_path / "beside" / "a.gltf", root=tmp_path).triangles == 2


def test_a_link_in_the_output_folder_does_not_lead_out_of_it(tmp_path: Path) -> None:
    path = with_file(tmp_path / "in", "sub/b.bin", "sub/b.bin")
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out" / "sub").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="leads out of the folder"):
        bake(path, tmp_path / "out" / "a.gltf")
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_folders_made_for_a_bake_that_fails_are_taken_back(tmp_path: Path) -> None:
    path = with_file(tmp_path / "in", "sub/b.bin", "sub/b.bin")
    out = tmp_path / "out"
    out.mkdir()
    (out / "a_ao.bin").mkdir()
    scene = load(path)
    blocked = tmp_path / "in" / "a.gltf"
    assert blocked.exists()
    (out / "a.gltf").mkdir()
    with pytest.raises(OutputError, match="this is a folder"):
        gltf.write(scene, ramp(scene), out / "a.gltf", StoreSettings())
    assert sorted(p.name for p in out.rglob("*")) == ["a.gltf", "a_ao.bin"]


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("data:application/octet-stream;base64", "no comma"),
        ("data:application/octet-stream;base64,A", "no base64"),
        ("data:application/octet-stream;base64,????", "no base64"),
        ("data:,abc", "claims 60 bytes, and there are 3"),
        ("missing.bin", "no such file"),
        ("a\0b", "no file name"),
        (".", "not a regular file"),
    ],
)
def test_a_buffer_that_cannot_be_had_is_refused(tmp_path: Path, uri: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        load(square_builder().gltf(tmp_path / "a.gltf", uri=uri))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("form", ["padded", "unpadded", "percent", "folded", "text"])
def test_data_uris_in_every_spelling_are_read(tmp_path: Path, form: str) -> None:
    path = square_builder().gltf(tmp_path / "a.gltf", embed=True)
    document = json.loads(path.read_text())
    head, _, body = document["buffers"][0]["uri"].partition(",")
    document["buffers"][0]["uri"] = {
        "padded": f"{head},{body}",
        "unpadded": f"{head},{body.rstrip('=')}",
        "percent": f"{head},{body.replace('/', '%2F').replace('+', '%2B')}",
        "folded": f"{head},{body[:20]}\n  {body[20:]}",
        "text": "data:," + "".join(f"%{byte:02x}" for byte in square_builder().data),
    }[form]
    path.write_text(json.dumps(document))
    np.testing.assert_array_equal(load(path).meshes[0].vertices, SQUARE)

"""Folders that are not on this machine: in memory, and in a store of a kind that shows what is half-written."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from aobake import AobakeError, InputError, OutputError, SettingsError
from aobake.batch.parcels import delivered
from aobake.batch.places import LocalFolder
from aobake.batch.remote import RemoteFolder, place_of
from aobake.batch.tasks import Outcome, Remote, Task
from aobake.batch.tree import Tree
from aobake.batch.worker import work
from tests.batch.farm import far, floor_and_ball, task_of, tree

fsspec = pytest.importorskip("fsspec", reason="the extra `cluster` is not installed")


@pytest.fixture
def store() -> Iterator[str]:
    """The URL of an empty folder in memory."""
    files = fsspec.filesystem("memory")
    files.store.clear()
    yield "memory://bucket"
    files.store.clear()


def put(url: str, **files: bytes) -> RemoteFolder:
    folder = RemoteFolder(url)
    for name, content in files.items():
        fsspec.filesystem("memory").pipe_file(f"{folder._path}/{name}", content)
    return folder


def upload(folder: Path, url: str) -> RemoteFolder:
    """All files of a local folder in a remote one."""
    remote = RemoteFolder(url)
    for name in tree(folder):
        remote.deliver(folder / name, name)
    return remote


def download(url: str, folder: Path) -> dict[str, bytes]:
    """All files of a remote folder, by way of a local one."""
    remote = RemoteFolder(url)
    for found in remote.files(lambda _: True):
        assert remote.fetch(found.name, folder / found.name)
    return tree(folder)


def test_files_come_in_the_order_of_their_names_without_the_folders_that_are_left_out(
    store: str,
) -> None:
    names = ["b.glb", "a/z.glb", "a.glb", "a/b/c.glb", "skip/me.glb", "a/skip/x.glb"]
    folder = put(f"{store}/in/", **{name: name.encode() for name in names})
    found = list(folder.files(lambda name: not name.endswith("skip")))
    assert [file.name for file in found] == sorted(names[:4])
    assert [file.stamp.size for file in found] == [5, 9, 7, 5]
    assert not any(file.problem for file in found)


def test_a_stamp_tells_another_content_of_the_same_size(store: str) -> None:
    folder = put(store, **{"a.glb": b"one"})
    before = folder.stamp("a.glb")
    assert before == folder.stamp("a.glb")
    put(store, **{"a.glb": b"two"})
    assert folder.stamp("a.glb") != before
    assert folder.stamp("missing.glb") is None
    assert folder.read("a.glb", 2) == b"tw"
    assert folder.digest("a.glb") == (
        "3fc4ccfe745870e2c0d99f71f30ff0656c8dedd41cc1d7d3d376b0dbe685e2f3"
    )


def test_a_store_is_not_asked_for_what_its_listing_does_not_name(
    store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each question is a request: a batch may know of thousands of outputs that somebody has removed."""
    folder = put(store, **{"a.glb": b"one"})
    tree = Tree(folder)
    monkeypatch.setattr(RemoteFolder, "stamp", None)
    assert tree.stamp("a.glb") is not None
    assert tree.stamp("missing.glb") is None
    assert tree.gone("missing.glb")


def test_files_are_copied_and_removed_and_a_second_removal_is_none(store: str) -> None:
    folder = put(store, **{"a.glb": b"one"})
    folder.copy("a.glb", "deep/down/b.glb")
    assert folder.read("deep/down/b.glb", 9) == b"one"
    folder.remove("a.glb")
    folder.remove("a.glb")
    assert [file.name for file in folder.files(lambda _: True)] == ["deep/down/b.glb"]


def test_what_a_killed_batch_left_is_removed_and_nothing_else(store: str) -> None:
    left = ["a/.aobake-0a1b2c3d-q_rstuvw.part", ".aobake-77ff77ff-tile0001.part"]
    kept = ["a/part", ".aobake/batch.json", "my.aobake-1.part.glb"]
    folder = put(store, **dict.fromkeys([*left, *kept], b"x"))
    assert sorted(folder.remove_leftovers()) == sorted(left)
    assert [file.name for file in folder.files(lambda _: True)] == sorted(kept)


@pytest.mark.parametrize("name", ["../secret", "a/../../b", "/etc/passwd", "a//b", "", "a/./b"])
def test_a_name_never_leads_out_of_its_folder(store: str, name: str) -> None:
    folder = put(f"{store}/in", a=b"x")
    for reach in (folder.digest, folder.remove, folder.stamp):
        with pytest.raises(AobakeError, match="its name cannot be"):
            reach(name)


def test_a_store_that_shows_what_is_half_written_shows_a_file_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = RemoteFolder(f"local://{tmp_path}/out")
    (tmp_path / "new").write_bytes(b"new content")
    folder.deliver(tmp_path / "new", "a/chair.glb")
    assert tree(tmp_path / "out") == {"a/chair.glb": b"new content"}

    def torn(source: str, target: str, **_: object) -> None:
        Path(target).write_bytes(Path(source).read_bytes()[:3])
        assert target.endswith(".part")
        raise ConnectionResetError("cable pulled")

    monkeypatch.setattr(folder._files, "put_file", torn)
    (tmp_path / "new").write_bytes(b"newer content")
    with pytest.raises(OutputError, match=r"out/a/chair.glb: it cannot be written \(cable pulled"):
        folder.deliver(tmp_path / "new", "a/chair.glb")
    assert tree(tmp_path / "out") == {"a/chair.glb": b"new content"}


def test_a_place_is_known_by_its_spelling(tmp_path: Path, store: str) -> None:
    assert isinstance(place_of(str(tmp_path)), LocalFolder)
    assert place_of(f"file://{tmp_path}/a%20b").path("c") == tmp_path / "a b" / "c"
    assert place_of(f"{store}/").name == store


@pytest.mark.parametrize(
    ("url", "needed"),
    [
        ("sftp://artist:hunter2@host/share", "put it where the"),
        ("s4://bucket", "Known: az, gs, hdfs, s3, "),
        ("simplecache::s3://bucket", "PROTOCOL://BUCKET/FOLDER"),
        ("s3://bucket/in?versionId=3", "PROTOCOL://BUCKET/FOLDER"),
        ("memory://bucket/../other", "Write it out"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_in_one_line(url: str, needed: str) -> None:
    with pytest.raises(SettingsError) as refused:
        place_of(url)
    assert needed in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "hunter2" not in str(refused.value)


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object, **__: object) -> None:
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr(fsspec, "url_to_fs", missing)
    with pytest.raises(SettingsError, match="Install s3fs to access S3"):
        RemoteFolder("s3://bucket")


def test_a_secret_among_the_options_is_shown_nowhere(
    store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = RemoteFolder(store, {"secret": "hunter2"})

    def leaking(*_: object, **__: object) -> None:
        raise PermissionError("Access denied for key hunter2\nTraceback ...")

    monkeypatch.setattr(type(folder._files), "open", leaking)
    with pytest.raises(InputError, match=r"Access denied for key \.\.\.\)") as refused:
        folder.digest("a.glb")
    assert "hunter2" not in str(refused.value)
    assert "hunter2" not in repr(folder)


def gltf(folder: Path) -> None:
    """A floor and a ball as .gltf, with its buffer under a name that must be percent-encoded."""
    import aobake

    floor_and_ball(folder / "ball.obj")
    scene = aobake.load(folder / "ball.obj")
    baked = aobake.bake_vertices(scene, aobake.BakeSettings(rays=4))
    aobake.save(baked, folder / "ball.gltf")
    document = json.loads((folder / "ball.gltf").read_text())
    (buffer,) = document["buffers"]
    (folder / "deep er").mkdir()
    shutil.move(folder / buffer["uri"], folder / "deep er" / "ball #1.bin")
    buffer["uri"] = "deep%20er/ball%20%231.bin"
    (folder / "ball.gltf").write_text(json.dumps(document))
    (folder / "ball.obj").unlink()


def textured_obj(folder: Path) -> None:
    """An OBJ file whose library, with a space in its name, names a texture in a folder."""
    floor_and_ball(folder / "ball.obj")
    text = (folder / "ball.obj").read_text()
    (folder / "ball.obj").write_text(f"mtllib my ball.mtl\nusemtl red\n{text}")
    (folder / "my ball.mtl").write_text("newmtl red\nmap_Kd -s 1 1 1 images\\red one.png\n")
    (folder / "images").mkdir()
    (folder / "images" / "red one.png").write_bytes(b"not looked into by a bake of vertices")


@pytest.mark.parametrize(("make", "name"), [(gltf, "ball.gltf"), (textured_obj, "ball.obj")])
def test_a_task_with_remote_folders_gives_the_files_of_a_local_one(
    store: str, tmp_path: Path, make: Callable[[Path], None], name: str
) -> None:
    home = tmp_path / "in" / "set one"
    home.mkdir(parents=True)
    make(home)
    task = task_of(tmp_path / "in", tmp_path / "out", f"set one/{name}")
    here = work(task)
    assert here.status == "done", here.reason
    upload(tmp_path / "in", f"{store}/in")
    there = work(far(task, f"{store}/in", f"{store}/out"))
    assert there.status == "done", there.reason
    assert download(f"{store}/out", tmp_path / "again") == tree(tmp_path / "out")
    assert there.inputs == here.inputs
    assert there.outputs == here.outputs
    told = json.dumps(there.report)
    assert f"{store}/in/set one/{name}" in told
    assert tempfile.gettempdir() not in told


def test_nothing_is_delivered_of_a_task_that_failed(store: str, tmp_path: Path) -> None:
    put(f"{store}/in", **{"chair.obj": b"v 0 0\n"})
    task = far(task_of(tmp_path, tmp_path, "chair.obj"), f"{store}/in", f"{store}/out")
    outcome = work(task)
    assert outcome.status == "failed"
    assert outcome.reason.startswith(f"{store}/in/chair.obj: line 1")

    def torn(local: Task) -> Outcome:
        local.job.output.write_bytes(b"half")
        return Outcome(number=0, status="failed", reason=f"{local.job.input}: torn")

    assert delivered(task, torn).reason == f"{store}/in/chair.obj: torn"
    assert list(RemoteFolder(f"{store}/out").files(lambda _: True)) == []
    missing = far(task_of(tmp_path, tmp_path, "table.obj"), f"{store}/in", f"{store}/out")
    assert work(missing).reason == f"{store}/in/table.obj: there is no such file."


@pytest.mark.parametrize("inside", [False, True])
def test_a_reference_is_followed_within_the_folder_of_the_asset_or_the_root(
    store: str, tmp_path: Path, inside: bool
) -> None:
    put(store, **{"in/a/chair.obj": b"mtllib ../shared.mtl\n", "in/shared.mtl": b"newmtl x\n"})
    put(store, **{"other.mtl": b"newmtl secret\n"})
    task = far(task_of(tmp_path, tmp_path, "a/chair.obj"), f"{store}/in", f"{store}/out")
    if inside:
        reading = replace(task.job.reading, root=Path())
        task = replace(task, job=replace(task.job, reading=reading))
    seen: list[str] = []

    def look(local: Task) -> Outcome:
        assert local.source is not None
        seen.extend(tree(local.source))
        return Outcome(number=0, status="failed", reason="seen")

    delivered(task, look)
    assert seen == (["a/chair.obj", "shared.mtl"] if inside else ["a/chair.obj"])


def test_one_folder_may_be_remote_and_the_other_one_here(store: str, tmp_path: Path) -> None:
    floor_and_ball(tmp_path / "in" / "ball.obj")
    task = task_of(tmp_path / "in", tmp_path / "out", "ball.obj")
    assert work(task).status == "done"
    to = replace(
        task,
        job=replace(task.job, output=Path("ball.obj")),
        target=None,
        remote=Remote(source=str(tmp_path / "in"), target=f"{store}/out"),
    )
    assert work(to).status == "done"
    assert download(f"{store}/out", tmp_path / "again") == tree(tmp_path / "out")
    upload(tmp_path / "in", f"{store}/in")
    back = replace(
        task,
        job=replace(task.job, input=Path("ball.obj"), output=tmp_path / "back" / "ball.obj"),
        source=None,
        target=tmp_path / "back",
        remote=Remote(source=f"{store}/in", target=str(tmp_path / "back")),
    )
    outcome = work(back)
    assert outcome.status == "done"
    assert outcome.outputs[0][0] == "ball.obj"
    assert tree(tmp_path / "back") == tree(tmp_path / "out")

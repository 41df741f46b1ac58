"""A store that is reached over a socket: folders behind s3://, with worker processes that know no more than we do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from aobake import InputError, SettingsError
from aobake.batch.processes import LocalExecutor
from aobake.batch.remote import RemoteFolder
from aobake.batch.tiles import TiledExecutor
from aobake.settings import BakeSettings
from tests.batch.farm import all_of, far, floor_and_ball, task_of, tree

fsspec = pytest.importorskip("fsspec", reason="the extra `cluster` is not installed")
pytest.importorskip("s3fs", reason="s3fs is not installed")
server = pytest.importorskip("moto.server", reason="moto with its server is not installed")


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """The address of a store that is S3 but for its being here."""
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    yield f"http://{host}:{port}"
    running.stop()


@pytest.fixture
def bucket(endpoint: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """The URL of an empty bucket, whose keys are where each process of its own accord looks for them."""
    for name, value in {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "artist",
        "AWS_SECRET_ACCESS_KEY": "hunter2hunter2",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_CONFIG_FILE": str(tmp_path / "none"),
        "AWS_SHARED_CREDENTIALS_FILE": str(tmp_path / "none"),
    }.items():
        monkeypatch.setenv(name, value)
    name = f"aobake{abs(hash(tmp_path))}"
    # fsspec keeps what was opened for a kind of store: an earlier test may have done so without keys.
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    fsspec.filesystem("s3", skip_instance_cache=True).mkdir(f"/{name}")
    return f"s3://{name}"


def test_objects_are_listed_stamped_copied_and_removed(bucket: str, tmp_path: Path) -> None:
    folder = RemoteFolder(f"{bucket}/in")
    (tmp_path / "a").write_bytes(b"one")
    for name in ("b c/ü.glb", "a.glb"):
        folder.deliver(tmp_path / "a", name)
    found = {file.name: file.stamp for file in folder.files(lambda _: True)}
    assert list(found) == ["a.glb", "b c/ü.glb"]
    assert folder.stamp("a.glb") == found["a.glb"]
    (tmp_path / "a").write_bytes(b"two")
    folder.deliver(tmp_path / "a", "a.glb")
    assert folder.stamp("a.glb") != found["a.glb"]
    folder.copy("a.glb", "d/e.glb")
    assert folder.digest("d/e.glb") == folder.digest("a.glb")
    folder.remove("a.glb")
    folder.remove("a.glb")
    assert folder.stamp("a.glb") is None
    assert [file.name for file in folder.files(lambda name: name != "d")] == ["b c/ü.glb"]


def test_a_bake_from_bucket_to_bucket_gives_the_files_of_a_local_one(
    bucket: str, tmp_path: Path
) -> None:
    (tmp_path / "out").mkdir()
    floor_and_ball(tmp_path / "in" / "ball.obj", fine=1)
    bake = BakeSettings(rays=4, size=256, supersample=4, denoise="off")
    texture = task_of(
        tmp_path / "in", tmp_path / "out", "ball.obj", 1,
        output="a b/ball.glb", command="texture", bake=bake,
    )  # fmt: skip
    vertex = task_of(tmp_path / "in", tmp_path / "out", "ball.obj", 2)
    RemoteFolder(f"{bucket}/in").deliver(tmp_path / "in" / "ball.obj", "ball.obj")
    remote = [far(task, f"{bucket}/in", f"{bucket}/out") for task in (texture, vertex)]
    with TiledExecutor(LocalExecutor(processes=2, threads=2), "on") as executor:
        here = all_of(executor, [texture, vertex])
        there = all_of(executor, remote)
    assert {outcome.status for outcome in there.values()} == {"done"}, there
    out = RemoteFolder(f"{bucket}/out")
    names = [found.name for found in out.files(lambda _: True)]
    assert names == sorted(tree(tmp_path / "out")), "and nothing of the tiles is left"
    for name in names:
        assert out.fetch(name, tmp_path / "again" / name)
    assert tree(tmp_path / "again") == tree(tmp_path / "out")
    assert {n: o.outputs for n, o in there.items()} == {n: o.outputs for n, o in here.items()}
    assert "hunter2" not in str(there)


def test_a_bucket_that_is_not_there_is_one_line(bucket: str) -> None:
    with pytest.raises((InputError, SettingsError), match="s3://no-such-bucket-here") as refused:
        list(RemoteFolder("s3://no-such-bucket-here").files(lambda _: True))
    assert "\n" not in str(refused.value)

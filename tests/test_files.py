"""Files: whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from aobake import InputError, OutputError, files


def test_several_files_are_written_with_their_content(tmp_path: Path) -> None:
    a, b = tmp_path / "a.bin", tmp_path / "b.bin"
    files.write_files({a: b"one", b: [b"t", memoryview(b"wo"), bytearray(b"!")]})
    assert (a.read_bytes(), b.read_bytes()) == (b"one", b"two!")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.bin", "b.bin"]


def test_a_file_is_replaced_and_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    path.chmod(0o640)
    files.write_files({path: b"new"})
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    files.write_files({tmp_path / "ours": b""})
    (tmp_path / "theirs").write_bytes(b"")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "theirs").stat().st_mode


def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tmp_path / "first.bin", tmp_path / "second.glb"
    second.write_bytes(b"old")

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        files.write_files({first: b"x" * 1000, second: b"new"})
    assert [p.name for p in tmp_path.iterdir()] == ["second.glb"]
    assert second.read_bytes() == b"old"


def test_an_interruption_in_the_second_file_takes_the_first_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0

    def interrupted(_handle: int) -> None:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        files.write_files({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="there is no folder"):
        files.write_files({tmp_path / "ok": b"", tmp_path / "no" / "file": b""})
    assert list(tmp_path.iterdir()) == []


def test_a_file_has_the_name_of_an_unfinished_one_until_it_is_whole(tmp_path: Path) -> None:
    meanwhile: list[str] = []

    def pieces() -> Iterator[bytes]:
        meanwhile.extend(path.name for path in tmp_path.iterdir())
        yield b"content"

    files.write_files({tmp_path / "a": pieces()})
    assert len(meanwhile) == 1
    assert meanwhile[0].startswith(files.PART)
    assert files.is_unfinished(meanwhile[0])
    assert not files.is_unfinished("a")
    assert not files.is_unfinished(f"{meanwhile[0]}.glb")


def test_a_folder_is_made_once_and_what_is_in_its_way_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "down"
    assert files.make_folder(folder)
    assert not files.make_folder(folder)
    (folder / "file").write_bytes(b"")
    with pytest.raises(OutputError, match=r"down/file: this folder cannot be made \(File exists"):
        files.make_folder(folder / "file")
    with pytest.raises(OutputError, match=r"^a\.glb: its folder .*file/b cannot be made"):
        files.make_folder(folder / "file" / "b", needed_by="a.glb")


def test_a_folder_is_no_target(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="this is a folder"):
        files.check_writable(tmp_path)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere"
)
def test_a_folder_without_permission_is_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="permissions"):
            files.check_writable(tmp_path / "a")
    finally:
        tmp_path.chmod(0o700)


def test_reading_what_is_not_there_names_it_and_who_needs_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^chair\.gltf: seat\.bin: there is no such file"):
        files.read_bytes(tmp_path / "seat.bin", needed_by="chair.gltf")
    with pytest.raises(InputError, match="not a regular file"):
        files.read_bytes(tmp_path)
    with pytest.raises(InputError):
        files.read_bytes(Path("a\0b"))


def test_the_digest_is_that_of_the_content(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"ambient" * 100_000)
    assert files.sha256(path) == hashlib.sha256(b"ambient" * 100_000).hexdigest()


def test_a_link_is_the_same_file_and_a_copy_is_not(tmp_path: Path) -> None:
    path, link, copy = tmp_path / "a", tmp_path / "link", tmp_path / "copy"
    path.write_bytes(b"1")
    copy.write_bytes(b"1")
    link.symlink_to(path)
    assert files.same_file(path, link)
    assert not files.same_file(path, copy)
    assert not files.same_file(path, tmp_path / "missing")

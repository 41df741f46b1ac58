"""A folder on this machine: what is found in it, and what becomes of its files."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

import pytest

from aobake import InputError, OutputError
from aobake.batch.places import Found, LocalFolder, local_folder

posix = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has no such links, names or modes"
)


def made(top: Path, *names: str) -> LocalFolder:
    for name in names:
        path = top / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode("utf-8", "surrogateescape"))
    return local_folder(top)


def found(place: LocalFolder) -> dict[str, Found]:
    return {file.name: file for file in place.files(lambda _: True)}


def test_everything_below_is_found_and_sorted(tmp_path: Path) -> None:
    place = made(tmp_path, "b/c.glb", "b.glb", "a/x/y.txt", "a.glb")
    assert [file.name for file in place.files(lambda _: True)] == [
        "a.glb", "a/x/y.txt", "b.glb", "b/c.glb",
    ]  # fmt: skip
    assert all(
        file.stamp.size == len(file.name) and not file.problem for file in found(place).values()
    )


def test_a_folder_that_is_not_entered_is_not_looked_into(tmp_path: Path) -> None:
    place = made(tmp_path, "a/x/1", "b/x/2")
    asked: list[str] = []

    def enters(folder: str) -> bool:
        asked.append(folder)
        return folder != "a"

    assert [file.name for file in place.files(enters)] == ["b/x/2"]
    assert sorted(asked) == ["a", "b", "b/x"]


@pytest.mark.parametrize(("name", "why"), [("missing", "no such folder"), ("file", "no folder")])
def test_what_is_no_folder_is_refused(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=why):
        local_folder(tmp_path / name).files(lambda _: True)


@posix
def test_links_are_followed_within_the_folder_and_not_out_of_it(tmp_path: Path) -> None:
    made(tmp_path / "elsewhere", "secret.glb", "folder/secret.glb")
    place = made(tmp_path / "in", "real/a.glb")
    top = place.folder
    (top / "b.glb").symlink_to("real/a.glb")
    (top / "linked").symlink_to("real")
    (top / "secret.glb").symlink_to(tmp_path / "elsewhere" / "secret.glb")
    (top / "out").symlink_to(tmp_path / "elsewhere" / "folder")
    (top / "nothing.glb").symlink_to("gone.glb")
    files = found(place)
    assert files["b.glb"].stamp == files["real/a.glb"].stamp
    assert "linked/a.glb" in files
    assert "leads out of the folder" in files["secret.glb"].problem
    assert "leads out of the folder" in files["out"].problem
    assert files["out"].folder
    assert "cannot be read" in files["nothing.glb"].problem
    assert "out/secret.glb" not in files


@posix
def test_a_folder_that_is_a_link_itself_is_as_good_as_any(tmp_path: Path) -> None:
    made(tmp_path / "real", "a.glb", "b/c.glb")
    (tmp_path / "link").symlink_to("real")
    assert list(found(local_folder(tmp_path / "link"))) == ["a.glb", "b/c.glb"]


@posix
def test_links_in_circles_are_left_out(tmp_path: Path) -> None:
    place = made(tmp_path, "a/b/c.glb")
    (tmp_path / "a" / "b" / "up").symlink_to("..")
    (tmp_path / "a" / "top").symlink_to(tmp_path)
    (tmp_path / "a" / "self").symlink_to("self")
    assert [name for name, file in found(place).items() if not file.problem] == ["a/b/c.glb"]


@posix
def test_folders_that_link_to_each_other_do_not_multiply(tmp_path: Path) -> None:
    """Thirty folders with two links to the next one each: a million million ways to the last."""
    place = made(tmp_path, *(f"{n:02}/a.glb" for n in range(30)))
    for n in range(29):
        for link in ("x", "y"):
            (tmp_path / f"{n:02}" / link).symlink_to(f"../{n + 1:02}")
    files = found(place)
    assert len(files) == 30 + 2 * 29
    assert not [file for file in files.values() if file.problem]


@posix
@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read anything"
)
def test_what_may_not_be_read_is_said(tmp_path: Path) -> None:
    place = made(tmp_path, "a.glb", "b/c.glb")
    (tmp_path / "a.glb").chmod(0)
    (tmp_path / "b").chmod(0)
    try:
        files = found(place)
    finally:
        (tmp_path / "b").chmod(0o700)
    assert "Permission denied" in files["a.glb"].problem
    assert "Permission denied" in files["b"].problem
    assert files["b"].folder


@posix
def test_a_folder_that_cannot_be_listed_is_said_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same without permissions, which do not bind everyone."""
    place = made(tmp_path, "a.glb", "b/c.glb", "d/e.glb")
    scan = os.scandir

    def refusing(path: str) -> object:
        if path.endswith("b"):
            raise PermissionError(13, "Permission denied", path)
        return scan(path)

    monkeypatch.setattr("os.scandir", refusing)
    files = found(place)
    assert list(files) == ["a.glb", "b", "d/e.glb"]
    assert (files["b"].problem, files["b"].folder) == (
        "it cannot be read (Permission denied).",
        True,
    )


@posix
def test_what_is_no_regular_file_is_said(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.glb")
    assert "not a regular file" in found(local_folder(tmp_path))["a.glb"].problem


@posix
def test_names_that_are_no_text_are_names_all_the_same(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9\n<script>.glb")
    try:
        (tmp_path / name).touch()
    except OSError:
        pytest.skip("this file system takes UTF-8 alone")
    place = local_folder(tmp_path)
    assert list(found(place)) == [name]
    assert place.path(name).exists()
    assert place.stamp(name) is not None


def test_a_stamp_tells_that_a_file_changed_and_that_it_is_gone(tmp_path: Path) -> None:
    place = made(tmp_path, "a.glb")
    before = place.stamp("a.glb")
    assert before == found(place)["a.glb"].stamp
    (tmp_path / "a.glb").write_bytes(b"other")
    times = (tmp_path / "a.glb").stat()
    assert place.stamp("a.glb") == found(place)["a.glb"].stamp != before
    assert times.st_size == 5
    (tmp_path / "a.glb").unlink()
    assert place.stamp("a.glb") is None
    assert place.stamp("a\0b") is None


@posix
def test_a_stamp_tells_a_file_that_was_given_its_old_time_again(tmp_path: Path) -> None:
    """As programs do that unpack archives; of the same size, only the other time differs."""
    place = made(tmp_path, "a.glb")
    before, times = place.stamp("a.glb"), (tmp_path / "a.glb").stat()
    (tmp_path / "new").write_bytes(b"b.glb")
    os.utime(tmp_path / "new", ns=(times.st_atime_ns, times.st_mtime_ns))
    os.replace(tmp_path / "new", tmp_path / "a.glb")
    assert place.stamp("a.glb") != before


def test_files_are_read_copied_and_removed(tmp_path: Path) -> None:
    place = made(tmp_path, "a.glb")
    assert place.digest("a.glb") == hashlib.sha256(b"a.glb").hexdigest()
    assert (place.read("a.glb", 3), place.read("a.glb", 99)) == (b"a.g", b"a.glb")
    place.copy("a.glb", "x/y/b.glb")
    place.remove("a.glb")
    place.remove("a.glb")
    assert list(found(place)) == ["x/y/b.glb"]
    assert place.read("x/y/b.glb", 99) == b"a.glb"


def test_what_cannot_be_done_is_one_line_with_the_file(tmp_path: Path) -> None:
    place = made(tmp_path, "a.glb", "folder/b.glb")
    for act in (lambda: place.digest("c.glb"), lambda: place.read("c.glb", 1)):
        with pytest.raises(InputError, match=r"c\.glb: it cannot be read \(No such file"):
            act()
    with pytest.raises(OutputError, match="folder: it cannot be removed"):
        place.remove("folder")
    with pytest.raises(OutputError, match=r"a\.glb: this folder cannot be made"):
        place.copy("folder/b.glb", "a.glb/b.glb")
    with pytest.raises(OutputError, match=r"d\.glb: it cannot be written"):
        place.copy("c.glb", "d.glb")
    assert list(found(place)) == ["a.glb", "folder/b.glb"]

"""A mesh mended for the bake: what is closed, what is left as it is, and what is said about it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import aobake
from aobake.findings import Finding
from tests.conftest import Run
from tests.support import one_line

BOX = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
)  # fmt: skip
INSIDE = SIDES[:, ::-1]  # seen from inside, the side z = 1 is missing


def mended(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    *,
    repair: bool = True,
    max_hole: int = 30,
) -> aobake.BakedVertices:
    if repair:
        pytest.importorskip("pymeshlab", reason="repair needs pymeshlab")
    scene = aobake.Scene.from_arrays(vertices, faces)
    return aobake.bake_vertices(
        scene, aobake.BakeSettings(rays=64, repair=repair, max_hole=max_hole)
    )


def counts(findings: tuple[Finding, ...]) -> dict[str, int]:
    return {finding.kind: finding.count for finding in findings}


def test_the_inside_of_a_box_is_dark_once_its_open_side_is_closed() -> None:
    open_box, closed = mended(BOX, INSIDE, repair=False), mended(BOX, INSIDE)
    assert (open_box.ao[0] > 0.05).all()
    np.testing.assert_array_equal(closed.ao[0], 0.0)
    assert counts(closed.findings)["closed-hole"] == 1


def test_a_hole_with_more_edges_than_asked_for_stays_open() -> None:
    assert (mended(BOX, INSIDE, max_hole=3).ao[0] > 0.05).all()
    assert (mended(BOX, INSIDE, max_hole=4).ao[0] == 0.0).all()


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_a_hole_is_closed_at_any_scale_and_place(scale: float) -> None:
    baked = mended(scale * (BOX + 1e6), INSIDE)
    np.testing.assert_array_equal(baked.ao[0], 0.0)


def test_a_soup_is_mended_as_what_it_looks_like() -> None:
    """Triangles that share no vertex, as in STL: 30 corners at 8 places."""
    baked = mended(BOX[INSIDE.reshape(-1)], np.arange(INSIDE.size).reshape(-1, 3))
    np.testing.assert_array_equal(baked.ao[0], 0.0)
    assert counts(baked.findings) == {"joined": 22, "closed-hole": 1, "inward": 12}


def test_a_hole_in_a_mesh_of_mixed_winding_is_closed() -> None:
    faces = np.where(np.arange(len(SIDES))[:, None] % 3 == 0, SIDES[:, ::-1], SIDES)
    baked = mended(BOX, faces)
    np.testing.assert_array_equal(baked.ao[0], 1.0)
    assert counts(baked.findings)["closed-hole"] == 1
    assert counts(baked.findings)["reoriented"] in {4, 6}  # the two patches follow either reading


def test_a_fin_does_not_keep_a_hole_from_being_closed() -> None:
    vertices = np.concatenate([BOX, [[0.5, 0.5, -3.0], [9.0, 9.0, 9.0]]])
    baked = mended(vertices, np.concatenate([INSIDE, [[0, 2, 8]]]))
    assert counts(baked.findings)["non-manifold"] == 2  # the ends of the edge
    assert counts(baked.findings)["closed-hole"] == 1
    assert counts(baked.findings)["unreferenced"] == 1
    np.testing.assert_array_equal(baked.ao[0][[1, 3, 5, 7]], 0.0)
    assert baked.ao[0][9] == 1.0


def test_the_outline_of_a_flat_sheet_is_no_hole() -> None:
    sheet = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    baked = mended(sheet, np.array([[0, 1, 2], [0, 2, 3]]))
    assert baked.findings == ()
    np.testing.assert_array_equal(baked.ao[0], 1.0)


def test_what_is_not_finite_or_has_no_area_does_not_matter() -> None:
    vertices = np.concatenate([BOX, [[np.nan, 0, 0]]])
    junk = [[0, 1, 8], [2, 2, 3], [0, 0, 0]]
    baked = mended(vertices, np.concatenate([INSIDE, junk]))
    np.testing.assert_array_equal(baked.ao[0][:8], 0.0)


@pytest.mark.parametrize("faces", [np.zeros((0, 3), np.int64), np.array([[0, 0, 1]])])
def test_nothing_to_mend_is_no_trouble(faces: NDArray[np.int64]) -> None:
    np.testing.assert_array_equal(mended(BOX, faces).ao[0], 1.0)


def test_a_moebius_band_is_baked() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rims = [
        np.stack([(1 + w * np.cos(t / 2)) * np.cos(t), (1 + w * np.cos(t / 2)) * np.sin(t), w * np.sin(t / 2)], 1)
        for w in (-0.3, 0.3)
    ]  # fmt: skip
    faces = []
    for i in range(24):
        c, d = (i + 1, i + 25) if i < 23 else (24, 0)
        faces += [[i, i + 24, d], [i, d, c]]
    baked = mended(np.concatenate(rims), np.array(faces), max_hole=100)
    assert np.isfinite(baked.ao[0]).all()


def test_the_asset_that_is_written_back_is_not_mended(tmp_path: Path) -> None:
    pytest.importorskip("pymeshlab", reason="repair needs pymeshlab")
    source = tmp_path / "box.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in BOX] + [
        f"f {a + 1} {b + 1} {c + 1}" for a, b, c in INSIDE
    ]
    source.write_text("# kept\n" + "\n".join(lines) + "\n", encoding="ascii")
    settings = aobake.BakeSettings(rays=16, repair=True)
    aobake.save(aobake.bake_vertices(aobake.load(source), settings), tmp_path / "out.obj")
    written = (tmp_path / "out.obj").read_text(encoding="ascii").splitlines()
    # each vertex has got its colour, 0, behind its coordinates; nothing else has changed
    assert [line.split()[:4] for line in written] == [line.split() for line in ["# kept", *lines]]
    assert [float(line.split()[4]) for line in written if line.startswith("v ")] == [0.0] * 8


def test_the_command_line_mends_and_says_so(tmp_path: Path, corner: Path, run: Run) -> None:
    pytest.importorskip("pymeshlab", reason="repair needs pymeshlab")
    text = corner.read_text(encoding="ascii").splitlines()
    del text[-36 + 14]  # a quad amid the wall
    corner.write_text("\n".join(text) + "\n", encoding="ascii")
    out = tmp_path / "out.obj"
    done = run("vertex", corner, "-o", out, "--rays", 16, "--repair")
    assert done.status == 0
    assert "1 hole was closed for the bake" in done.err
    strict = run("vertex", corner, "-o", out, "--rays", 16, "--repair", "--strict", "--force")
    assert strict.status == 1
    assert one_line(strict.err, "corner.obj", "Mend the asset")


def test_without_pymeshlab_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymeshlab", None)
    with pytest.raises(aobake.EngineError, match=r"pip install \"aobake\[repair\]\""):
        aobake.bake_vertices(
            aobake.Scene.from_arrays(BOX, SIDES), aobake.BakeSettings(rays=1, repair=True)
        )

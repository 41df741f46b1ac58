"""Tangent frames: MikkTSpace's, against a slow transcription of its definition; and what normal maps do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aobake.atlas.tangents import (
    in_tangent_space,
    normal_mapped,
    placed_tangents,
    tangents_at_corners,
)
from tests.scenes import FloatArray, IntArray, Triangles, icosphere, patch, unit

Frame = tuple[FloatArray, float]


def smooth_normals(mesh: Triangles) -> FloatArray:
    """(F, 3, 3) unit normals, the same for all corners of a vertex."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    sums = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(sums, mesh.faces[:, k], np.cross(b - a, c - a))
    normals = sums / np.linalg.norm(sums, axis=1)[:, None]
    return np.asarray(normals[mesh.faces])


class SlowMikkTSpace:
    """Steps of the reference, one corner at a time, with dictionaries and recursion.

    Source: M. Mikkelsen, Simulation of wrinkled surfaces revisited, 2008, chapter 2; mikktspace.c, 2011.
    """

    def __init__(self, positions: FloatArray, normals: FloatArray, uv: FloatArray) -> None:
        self.p, self.n, self.t = positions, normals, uv
        self.groups: dict[tuple[int, int], int] = {}
        self.turns: list[bool] = []
        self.sound = [f for f in range(len(positions)) if len(set(map(tuple, positions[f]))) == 3]
        self.turn = {f: self.signed(f) > 0.0 for f in self.sound}
        self.any = {f: self.signed(f) == 0.0 for f in self.sound}
        self.edges: dict[tuple[int, int], int] = {}
        for f in self.sound:
            for k in range(3):
                self.edges.setdefault((self.key(f, k), self.key(f, (k + 1) % 3)), f)

    def key(self, f: int, k: int) -> int:
        return hash((*self.p[f, k], *self.n[f, k], *self.t[f, k]))

    def signed(self, f: int) -> float:
        a, b = self.t[f, 1] - self.t[f, 0], self.t[f, 2] - self.t[f, 0]
        return float(a[0] * b[1] - a[1] * b[0])

    def gather(self, f: int, k: int, group: int) -> None:
        if (f, k) in self.groups:
            return
        if self.any[f] and not any((f, i) in self.groups for i in range(3)):
            self.turn[f] = self.turns[group]
        if self.turn[f] != self.turns[group]:
            return
        self.groups[f, k] = group
        key, ahead, back = (self.key(f, (k + i) % 3) for i in range(3))
        for edge in ((ahead, key), (key, back)):
            if edge in self.edges:
                other = self.edges[edge]
                self.gather(other, [self.key(other, i) for i in range(3)].index(key), group)

    def share(self, f: int, k: int) -> FloatArray:
        """What one corner adds to its group's tangent."""
        if self.any[f]:
            return np.zeros(3)
        d1, d2 = self.p[f, 1] - self.p[f, 0], self.p[f, 2] - self.p[f, 0]
        s, t = self.t[f, 1] - self.t[f, 0], self.t[f, 2] - self.t[f, 0]
        along = (t[1] * d1 - s[1] * d2) * math.copysign(1.0, self.signed(f))
        n = self.n[f, k]
        flat = [v - (v @ n) * n for v in self.p[f, [(k + 1) % 3, (k + 2) % 3]] - self.p[f, k]]
        cosine = unit(flat[0]) @ unit(flat[1])
        return np.asarray(math.acos(np.clip(cosine, -1.0, 1.0)) * unit(along - (along @ n) * n))

    def frames(self) -> dict[tuple[int, int], Frame]:
        for f in self.sound:
            for k in range(3):
                if not self.any[f] and (f, k) not in self.groups:
                    self.turns.append(self.turn[f])
                    self.gather(f, k, len(self.turns) - 1)
        sums = [np.zeros(3) for _ in self.turns]
        for (f, k), group in self.groups.items():
            sums[group] = sums[group] + self.share(f, k)
        return {
            corner: (unit(sums[group]), -1.0 if self.turns[group] else 1.0)
            for corner, group in self.groups.items()
        }


def agree(positions: FloatArray, normals: FloatArray, uv: FloatArray) -> int:
    """How many corners have a frame by definition; all of those are what they should be."""
    found = tangents_at_corners(positions, normals, uv)
    expected = SlowMikkTSpace(positions, normals, uv).frames()
    for (f, k), (tangent, sign) in expected.items():
        assert np.abs(found[f, k, :3] - tangent).max() < 1e-9
        assert found[f, k, 3] == sign
    assert np.abs(np.linalg.norm(found[..., :3], axis=2) - 1.0).max(initial=0.0) < 1e-12
    assert np.abs((found[..., :3] * normals).sum(axis=2)).max(initial=0.0) < 1e-9
    assert set(np.unique(found[..., 3])) <= {-1.0, 1.0}
    return len(expected)


def bumpy(seed: int) -> Triangles:
    sphere = icosphere(2)
    noise = np.random.default_rng(seed).normal(0.0, 0.03, sphere.vertices.shape)
    return Triangles(sphere.vertices + noise, sphere.faces)


def around(vertices: FloatArray) -> FloatArray:
    """(V, 2) longitude and latitude, with all the wrong that the seam and the poles bring."""
    longitude = np.arctan2(vertices[:, 1], vertices[:, 0]) / (2.0 * math.pi) + 0.5
    return np.stack([longitude, np.arccos(np.clip(vertices[:, 2], -1.0, 1.0)) / math.pi], axis=1)


@pytest.mark.parametrize("seed", [0, 1])
def test_frames_of_a_bumpy_sphere_are_those_of_the_definition(seed: int) -> None:
    mesh = bumpy(seed)
    uv = around(mesh.vertices)[mesh.faces]
    assert agree(mesh.vertices[mesh.faces], smooth_normals(mesh), uv) == 3 * len(mesh.faces)


def test_frames_are_parted_where_coordinates_are_mirrored() -> None:
    mesh = bumpy(2)
    uv = np.abs(mesh.vertices[:, :2] @ np.array([[1.0, 0.2], [0.1, 1.0]]))[mesh.faces]
    agree(mesh.vertices[mesh.faces], smooth_normals(mesh), uv)
    found = tangents_at_corners(mesh.vertices[mesh.faces], smooth_normals(mesh), uv)
    assert set(np.unique(found[..., 3])) == {-1.0, 1.0}


def test_faces_without_an_area_in_the_image_go_with_their_neighbours() -> None:
    mesh = bumpy(3)
    uv = np.round(6.0 * around(mesh.vertices)) / 6.0
    count = agree(mesh.vertices[mesh.faces], smooth_normals(mesh), uv[mesh.faces])
    assert 0 < count <= 3 * len(mesh.faces)


def test_faces_without_a_surface_take_the_frame_of_a_corner_that_is_the_same() -> None:
    mesh = bumpy(4)
    flat = np.concatenate([mesh.faces, mesh.faces[:3][:, [0, 1, 1]]]).astype(np.int32)
    normals, uv = smooth_normals(mesh), around(mesh.vertices)
    normals = np.concatenate([normals, normals[:3][:, [0, 1, 1]]])
    assert agree(mesh.vertices[flat], normals, uv[flat]) == 3 * len(mesh.faces)
    found = tangents_at_corners(mesh.vertices[flat], normals, uv[flat])
    assert np.array_equal(found[-3:, :2], found[:3, :2])


def square(uv: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """A square that looks up z, x to the right and y up; positions, normals and uv at its corners."""
    mesh = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    positions = mesh.vertices[mesh.faces]
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), positions.shape)
    return positions, normals, uv[mesh.faces], mesh.faces


def test_an_image_seen_upright_has_its_tangent_right_and_its_bitangent_up() -> None:
    """The vertices are (0, 0), (0, 1), (1, 0), (1, 1); v runs down."""
    positions, normals, uv, _ = square(np.array([(0, 1), (0, 0), (1, 1), (1, 0.0)]))
    found = tangents_at_corners(positions, normals, uv)
    assert np.abs(found - np.array([1.0, 0.0, 0.0, 1.0])).max() < 1e-15


def test_an_image_seen_from_behind_has_its_tangent_left_and_its_bitangent_up_still() -> None:
    positions, normals, uv, _ = square(np.array([(1, 1), (1, 0), (0, 1), (0, 0.0)]))
    found = tangents_at_corners(positions, normals, uv)
    assert np.abs(found - np.array([-1.0, 0.0, 0.0, -1.0])).max() < 1e-15
    up = np.cross(normals, found[..., :3]) * found[..., 3:]
    assert np.abs(up - np.array([0.0, 1.0, 0.0])).max() < 1e-15


def test_without_any_direction_a_frame_is_across_the_normal_all_the_same() -> None:
    positions, normals, uv, _ = square(np.full((4, 2), 0.5))
    found = tangents_at_corners(positions, normals, uv)
    assert np.abs((found[..., :3] * normals).sum(axis=2)).max() == 0.0
    assert (found[..., 3] == 1.0).all()
    assert tangents_at_corners(*(np.zeros((0, 3, k)) for k in (3, 3, 2))).shape == (0, 3, 4)


# -- normal maps -----------------------------------------------------------------------------------


def mapped(
    stored: tuple[float, float, float], scale: float = 1.0, sign: float = 1.0
) -> list[float]:
    """What a normal map turns +z to on a square whose image is seen upright (sign: or mirrored)."""
    up = np.array([[0.0, 0.0, 1.0]])
    tangent = np.array([[1.0, 0.0, 0.0, sign]])
    found = normal_mapped(np.array([stored], np.float32), scale, tangent, up, up)
    return [round(float(x), 6) for x in found[0]]


def test_red_turns_right_and_green_turns_up_the_image() -> None:
    half = round(math.sqrt(0.5), 6)
    assert mapped((0.5, 0.5, 1.0)) == [0.0, 0.0, 1.0]
    assert mapped((1.0, 0.5, 1.0)) == [half, 0.0, half]
    assert mapped((0.5, 1.0, 1.0)) == [0.0, half, half]
    assert mapped((0.5, 1.0, 1.0), sign=-1.0) == [0.0, -half, half]


def test_the_scale_flattens_a_normal_map() -> None:
    assert mapped((1.0, 1.0, 1.0), scale=0.0) == [0.0, 0.0, 1.0]
    assert mapped((1.0, 0.5, 1.0), scale=0.5)[0] == round(0.5 / math.sqrt(1.25), 6)


@pytest.mark.parametrize("stored", [(1.0, 0.5, 0.5), (1.0, 0.0, 0.0), (0.5, 0.5, 0.0)])
def test_no_normal_is_turned_below_the_surface(stored: tuple[float, float, float]) -> None:
    found = np.array(mapped(stored))
    assert found[2] >= 0.01 - 1e-6
    assert abs(float(np.linalg.norm(found)) - 1.0) < 1e-5


def test_a_map_or_a_tangent_without_direction_leaves_the_normal() -> None:
    normal = unit((1.0, 2.0, 2.0))[None]
    along = np.concatenate([normal, [[1.0]]], axis=1)  # not across the normal at all
    for stored, tangent in (
        ((0.5, 0.5, 0.5), np.array([[1.0, 0, 0, 1]])),
        ((0.9, 0.5, 0.9), along),
    ):
        found = normal_mapped(np.array([stored], np.float32), 1.0, tangent, normal, normal)
        assert np.abs(found - normal).max() < 1e-7


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_what_is_held_along_tangents_is_what_a_normal_map_gives_back(mirror: float) -> None:
    """Also where tangents are no unit vectors and lean, and where the instance is mirrored and sheared."""
    rng = np.random.default_rng(3)
    frames = np.concatenate([rng.normal(size=(9, 3, 3)), np.ones((9, 3, 1))], axis=2)
    linear = np.diag([mirror, 2.0, 0.5]) + 0.1
    faces, weights = np.arange(9, dtype=np.int32), np.full((9, 2), 1.0 / 3.0)
    tangents = placed_tangents(frames, faces, weights, linear)
    assert (tangents[:, 3] == (1.0 if np.linalg.det(linear) > 0.0 else -1.0)).all()
    normals = np.array([unit(rng.normal(size=3)) for _ in faces])
    wanted = np.array([unit(n + 0.6 * unit(rng.normal(size=3))) for n in normals])
    held = in_tangent_space(wanted, tangents, normals)
    stored = (0.5 * held + 0.5).astype(np.float32)
    assert normal_mapped(stored, 1.0, tangents, normals, normals) == pytest.approx(wanted, abs=1e-6)

"""Lookups in images: closed forms of wrapping and filtering."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas.lookup import AT_ONCE, looked_up, sample
from aobake.errors import InputError
from aobake.meshes.scene import Texture, Wrap
from tests.scenes import FloatArray


def ramp(count: int) -> NDArray[np.float32]:
    """One row of pixels that hold their numbers."""
    return np.arange(count, dtype=np.float32)[None, :]


def along(u: FloatArray) -> FloatArray:
    return np.stack([u, np.full_like(u, 0.5)], axis=1)


def test_the_middle_of_a_pixel_is_the_pixel_and_between_them_is_linear() -> None:
    pixels = np.random.default_rng(0).random((5, 7, 3)).astype(np.float32)
    rows, columns = np.mgrid[:5, :7]
    centres = np.stack([(columns + 0.5) / 7, (rows + 0.5) / 5], axis=-1).reshape(-1, 2)
    assert np.abs(sample(pixels, centres) - pixels.reshape(-1, 3)).max() < 1e-6
    between = sample(pixels, np.array([[3.0 / 7, 2.0 / 5]]))[0]
    assert np.abs(between - pixels[1:3, 2:4].mean(axis=(0, 1))).max() < 1e-6


def test_v_runs_down_from_the_first_row() -> None:
    pixels = np.array([[0.0], [1.0]], np.float32)
    assert sample(pixels, np.array([[0.5, 0.25], [0.5, 0.75]])).reshape(-1).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize(
    ("wrap", "numbers"),
    [
        ("repeat", [2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2]),
        ("mirror", [1, 0, 0, 1, 2, 3, 3, 2, 1, 0, 0, 1, 2]),
        ("clamp", [0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 3, 3, 3]),
    ],
)
def test_what_lies_outside_is_what_the_wrap_says(
    wrap: Wrap, numbers: list[int], nearest: bool
) -> None:
    u = (np.arange(-2.0, 11.0) + 0.5) / 4.0
    found = sample(ramp(4), along(u), (wrap, "clamp"), nearest)
    assert found.reshape(-1).tolist() == numbers
    down = sample(ramp(4).T, along(u)[:, ::-1], ("clamp", wrap), nearest)
    assert down.reshape(-1).tolist() == numbers


@pytest.mark.parametrize(("wrap", "value"), [("repeat", 1.5), ("mirror", 0.0), ("clamp", 0.0)])
def test_the_edge_is_filtered_with_what_the_wrap_puts_beside_it(wrap: Wrap, value: float) -> None:
    found = sample(ramp(4), along(np.array([0.0])), (wrap, wrap))
    assert float(found[0, 0]) == value


def test_nearest_takes_the_pixel_that_the_place_is_in() -> None:
    u = np.array([0.0, 0.249, 0.25, 0.749, 0.999])
    assert sample(ramp(4), along(u), nearest=True).reshape(-1).tolist() == [0, 0, 1, 2, 3]


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize("nearest", [False, True])
def test_wild_coordinates_look_something_up(wrap: Wrap, nearest: bool) -> None:
    u = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, -1e-300, np.nextafter(1.0, 0.0)])
    found = sample(ramp(4), along(u), (wrap, wrap), nearest)
    assert ((found >= 0.0) & (found <= 3.0)).all()


def test_a_texture_is_looked_up_where_its_transform_puts_it() -> None:
    texture = Texture(
        image=0, transform=np.array([[0.0, 1.0, 0.25], [1.0, 0.0, 0.0]]), wrap=("repeat", "clamp")
    )
    found = looked_up(texture, ramp(4), np.array([[0.3, 0.125]]))
    assert found.tolist() == [[1.0]]


def test_many_places_are_looked_up_like_few() -> None:
    pixels = np.random.default_rng(1).random((9, 4, 2)).astype(np.float32)
    uv = np.random.default_rng(2).random((AT_ONCE + 5, 2))
    found = sample(pixels, uv)
    assert found.shape == (AT_ONCE + 5, 2)
    assert np.array_equal(found[-9:], sample(pixels, uv[-9:]))
    assert sample(pixels, np.zeros((0, 2))).shape == (0, 2)


def test_an_image_without_pixels_is_refused() -> None:
    with pytest.raises(InputError, match="no pixels"):
        sample(np.zeros((0, 4), np.float32), np.zeros((1, 2)))

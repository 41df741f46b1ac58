"""Images in and out: nothing lost, nothing converted, and refusals in one line."""

from __future__ import annotations

import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import images
from aobake.errors import EngineError, InputError, OutputError
from aobake.images import (
    ENCODINGS,
    KINDS,
    decode,
    encode,
    fill_holes,
    resized,
    text_size,
    with_text,
)
from aobake.settings import Encoding

Pixels = NDArray[np.float32]
ALL = [(kind, encoding) for kind, encodings in ENCODINGS.items() for encoding in encodings]
COARSENESS: dict[Encoding, float] = {
    "8": 1 / 255,
    "16": 0.6 / 65535,
    "half": 2.0**-11,
    "float": 0.0,
}


def noise(*shape: int) -> Pixels:
    return np.random.default_rng(7).random(shape, np.float32)


def png(width: int, height: int, depth: int, color: int, rows: bytes, *extra: bytes) -> bytes:
    """A PNG made by hand; extra: chunks between the header and the pixels, each its type and content."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    chunks = [b"IHDR" + header, *extra, b"IDAT" + zlib.compress(rows), b"IEND"]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
        for chunk in chunks
    )


def chunk_types(data: bytes) -> set[bytes]:
    return {kind for kind, _, _ in images._png_chunks(data)}


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize(("kind", "encoding"), ALL)
def test_pixels_come_back(kind: images.Kind, encoding: Encoding, channels: int) -> None:
    """Alpha is nothing special: it does not darken what it goes with."""
    pixels = noise(300, 7, channels)
    back = decode(encode(pixels, kind, encoding), "page")
    assert back.shape == pixels.shape
    assert back.dtype == np.float32
    assert np.abs(back - pixels).max() <= COARSENESS[encoding] + 1e-7


def test_a_plane_is_one_channel() -> None:
    assert decode(encode(noise(3, 5), "png", "16"), "page").shape == (3, 5, 1)


@pytest.mark.parametrize(("kind", "encoding"), ALL)
def test_the_same_pixels_give_the_same_bytes(kind: images.Kind, encoding: Encoding) -> None:
    """Writers of EXR and TIFF put the hour into the file, unless they are kept from it."""
    once = encode(noise(9, 9), kind, encoding)
    year = time.strftime("%Y").encode()
    assert year not in once[:300]
    assert once == encode(noise(9, 9), kind, encoding)


@pytest.mark.parametrize("value", [0.0, 1.0, 128 / 255, 51 / 255, 3 / 255])
def test_a_value_that_eight_bits_hold_stays_everywhere(value: float) -> None:
    page = np.full((70, 300), value, np.float32)
    assert (np.rint(decode(encode(page, "png", "8"), "page") * 255.0) == round(value * 255)).all()


@pytest.mark.parametrize("share", [0.1, 0.5, 0.77])
def test_dithering_keeps_the_mean_and_moves_nothing_by_a_step(share: float) -> None:
    """Any 16 x 16 pixels have the mean of what they stand for, to a twentieth of a step."""
    page = np.full((512, 512), (100 + share) / 255.0, np.float32)
    steps = np.rint(decode(encode(page, "png", "8"), "page")[:, :, 0] * 255.0)
    assert set(np.unique(steps)) == {100.0, 101.0}
    means = steps.reshape(32, 16, 32, 16).mean(axis=(1, 3))
    assert np.abs(means - (100 + share)).max() < 0.05


def test_a_gradient_shows_no_bands() -> None:
    """Averaged over 16 columns of 64, a ramp over two steps is straight; rounded, it would be off by 0.5."""
    ramp = np.broadcast_to(np.linspace(100, 102, 1024, dtype=np.float32) / 255.0, (64, 1024))
    steps = decode(encode(np.ascontiguousarray(ramp), "png", "8"), "page")[:, :, 0] * 255.0
    straight = (ramp * 255.0).reshape(64, 64, 16).mean(axis=(0, 2))
    assert np.abs(steps.reshape(64, 64, 16).mean(axis=(0, 2)) - straight).max() < 0.05


def test_whole_numbers_are_clipped_and_never_undefined() -> None:
    page = np.array([[-1.0, 2.0, np.nan, np.inf]], np.float32)
    for encoding in ("8", "16"):
        assert decode(encode(page, "png", encoding), "page").reshape(-1).tolist() == [0, 1, 0, 1]


def test_floats_keep_what_is_brighter_than_white() -> None:
    page = np.array([[-1.0, 2.0, 1e5]], np.float32)
    assert (decode(encode(page, "exr", "float"), "page").reshape(-1) == page).all()


def test_data_says_nothing_about_colour_and_a_picture_does() -> None:
    """A gamma chunk would have some readers convert what is no colour."""
    assert chunk_types(encode(noise(4, 4), "png", "8")) == {b"IHDR", b"IDAT", b"IEND"}
    assert chunk_types(encode(noise(4, 4, 3), "png", "8", srgb=True)) == {
        b"IHDR",
        b"sRGB",
        b"IDAT",
        b"IEND",
    }


def test_a_tiff_of_halves_holds_halves() -> None:
    page = noise(64, 64)
    assert len(encode(page, "tiff", "half")) < 0.75 * len(encode(page, "tiff", "float"))


@pytest.mark.parametrize(
    ("kind", "encoding", "said"),
    [("png", "half", "8, 16"), ("exr", "8", "half, float")],
)
def test_what_a_kind_cannot_hold_is_refused(
    kind: images.Kind, encoding: Encoding, said: str
) -> None:
    with pytest.raises(OutputError, match=said):
        encode(noise(2, 2), kind, encoding)


@pytest.mark.parametrize("shape", [(0, 4), (4, 4, 5), (4,)])
def test_what_is_no_image_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(OutputError, match="shape"):
        encode(np.zeros(shape, np.float32), "png", "8")


@pytest.mark.parametrize("kind", list(ENCODINGS))
def test_without_an_encoding_a_kind_takes_its_first(kind: images.Kind) -> None:
    assert encode(noise(5, 5), kind) == encode(noise(5, 5), kind, ENCODINGS[kind][0])


def test_every_ending_has_a_kind_that_holds_something() -> None:
    assert set(KINDS.values()) == set(ENCODINGS)
    assert all(ENCODINGS.values())


@pytest.mark.parametrize(
    ("depth", "row", "steps"),
    [(1, b"\x00\x40", [0, 1]), (2, b"\x00\x60", [1, 2]), (4, b"\x00\x3f", [3, 15])],
)
def test_grey_of_few_bits_is_scaled(depth: int, row: bytes, steps: list[int]) -> None:
    back = decode(png(2, 1, depth, 0, row), "few.png").reshape(-1)
    assert back == pytest.approx(np.array(steps) / (2**depth - 1), abs=1e-6)


def test_a_palette_is_looked_up() -> None:
    palette = b"PLTE" + bytes([10, 20, 30, 40, 50, 60])
    back = decode(png(2, 1, 1, 3, b"\x00\x40", palette), "palette.png")
    assert np.rint(back * 255).tolist() == [[[10, 20, 30], [40, 50, 60]]]


def test_colour_under_transparent_pixels_is_kept() -> None:
    back = decode(png(1, 1, 8, 6, b"\x00" + bytes([10, 20, 30, 0])), "clear.png")
    assert np.rint(back * 255).reshape(-1).tolist() == [10, 20, 30, 0]


def test_a_gamma_chunk_changes_nothing() -> None:
    plain = png(1, 1, 8, 0, b"\x00\x64")
    assert (
        decode(plain, "a")
        == decode(png(1, 1, 8, 0, b"\x00\x64", b"gAMA" + struct.pack(">I", 100000)), "b")
    ).all()


DAMAGE = {
    "no image": b"# a text\n" * 20,
    "a KTX texture": b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(80),
    "ends in the middle": encode(noise(40, 40), "png", "8")[:-30],
    "cannot be read": encode(noise(40, 40), "exr", "float")[:400],
    "16384": png(20000, 20000, 8, 0, b"\x00"),
    "damaged": encode(noise(40, 40), "png", "8").replace(b"IDAT", b"IDAT\x00", 1)[:-1],
}


@pytest.mark.parametrize("said", list(DAMAGE))
def test_what_cannot_be_read_is_refused_in_one_line(
    said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """And the libraries below say nothing by themselves."""
    with pytest.raises(InputError, match=said) as refusal:
        decode(DAMAGE[said], "seat.png")
    assert str(refusal.value).startswith("seat.png: ")
    assert "\n" not in str(refusal.value)
    assert capfd.readouterr() == ("", "")


def test_no_content_is_no_image() -> None:
    with pytest.raises(InputError, match="no image"):
        decode(b"", "seat.png")


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    decode(encode(noise(4, 4), "png", "8"), "page")
    with pytest.raises(InputError):
        decode(DAMAGE["cannot be read"], "page")
    assert list(tmp_path.iterdir()) == []


def test_filling_holes_keeps_what_is_known_and_stays_between_its_values() -> None:
    values, covered = noise(60, 50, 2), np.random.default_rng(1).random((60, 50)) < 0.1
    values[~covered] = np.nan
    filled = fill_holes(values, covered)
    assert (filled[covered] == values[covered]).all()
    assert filled.min() >= values[covered].min() - 1e-6
    assert filled.max() <= values[covered].max() + 1e-6


def test_without_anything_known_there_is_nothing_to_fill_from() -> None:
    values = noise(4, 4, 1)
    assert (fill_holes(values, np.zeros((4, 4), bool)) == values).all()


def test_halving_takes_the_mean_of_four() -> None:
    pixels = noise(8, 12, 3)
    mean = pixels.reshape(4, 2, 6, 2, 3).mean(axis=(1, 3))
    assert resized(pixels, 6, 4) == pytest.approx(mean, abs=1e-6)


@pytest.mark.parametrize(("width", "height"), [(5, 3), (31, 40)])
def test_another_size_stays_between_the_values(width: int, height: int) -> None:
    small = resized(noise(8, 12, 3), width, height)
    assert small.shape == (height, width, 3)
    assert small.min() >= 0.0
    assert small.max() <= 1.0


def test_text_stays_in_the_box_that_was_foretold() -> None:
    """Whatever the letters, a line has the same height."""
    width, height = text_size("Åpril gjy|", 24)
    drawn = with_text(np.zeros((80, 200, 3), np.float32), "Åpril gjy|", 20, 30, 24, (1.0, 0.5, 0.0))
    rows, columns = np.nonzero(drawn[:, :, 0] > 0.02)
    assert 30 <= rows.min() <= 33
    assert 30 + height - 3 <= rows.max() + 1 <= 30 + height
    assert columns.min() >= 20
    assert columns.max() + 1 <= 20 + width
    assert drawn[:, :, 1] == pytest.approx(drawn[:, :, 0] / 2, abs=1e-6)
    assert text_size("x", 24)[1] == height
    assert text_size("", 24) == (0, height)


def test_text_beyond_the_image_is_cut_off() -> None:
    picture = np.full((20, 20, 4), 0.25, np.float32)
    assert (with_text(picture, "far away", 100, 100, 12, (1, 1, 1, 1)) == picture).all()


def test_a_missing_font_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "_font", lambda: "no such font anywhere")
    with pytest.raises(EngineError, match="no text can be drawn"):
        text_size("x", 12)

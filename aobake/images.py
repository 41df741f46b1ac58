"""Images in and out of bytes, holes, sizes and labels: the one file that imports OpenImageIO.

Pixels are (H, W, C) float32 with row 0 at the top. Nothing here knows what they mean: no colour is
converted, and alpha is neither multiplied in nor taken out.
"""

from __future__ import annotations

import functools
import struct
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - its own documentation calls it so
from numpy.typing import NDArray

from aobake.errors import EngineError, InputError, OutputError
from aobake.files import read_bytes
from aobake.settings import Encoding

__all__ = [
    "ENCODINGS",
    "KINDS",
    "Kind",
    "decode",
    "encode",
    "fill_holes",
    "resized",
    "text_size",
    "with_text",
]

Pixels = NDArray[np.float32]
Kind = Literal["png", "exr", "tiff"]

KINDS: dict[str, Kind] = {".png": "png", ".exr": "exr", ".tif": "tiff", ".tiff": "tiff"}
ENCODINGS: dict[Kind, tuple[Encoding, ...]] = {
    "png": ("8", "16"),
    "exr": ("half", "float"),
    "tiff": ("8", "16", "half", "float"),
}
OIIO_NAMES: dict[Encoding, str] = {"8": "uint8", "16": "uint16", "half": "half", "float": "float"}

MOST_PIXELS = 1 << 28  # 16384 x 16384, the largest texture that graphics cards take
SIGNATURES = (  # how a content begins, and the ending that has OpenImageIO take the right reader
    (b"\x89PNG\r\n\x1a\n", ".png"),
    (b"\xff\xd8\xff", ".jpg"),
    (b"v/1\x01", ".exr"),
    (b"II*\x00", ".tif"),
    (b"MM\x00*", ".tif"),
    (b"BM", ".bmp"),
    (b"GIF8", ".gif"),
    (b"#?", ".hdr"),
    (b"DDS ", ".dds"),
)

# On a 4096 x 4096 page of dithered AO: level 3 takes 0.8 s for 3.9 MB, zlib's own 6 takes 2.0 s for 3.7 MB,
# 1 takes 0.5 s for 4.2 MB; choosing a filter line by line costs half as much again and saves nothing.
PNG_LEVEL = 3
PNG_FILTER_AVERAGE = 0x40
TALLEST = "|ÅÁgjp"  # letters that reach as far up and down as any
BAND = 256  # rows that are brought to whole numbers at a time


def decode(data: bytes, name: str) -> Pixels:
    """The pixels of an image file.

    data : what the file holds: PNG, JPEG, WebP, TIFF, EXR, BMP, GIF, HDR, DDS, or TGA where the name says so
    name : what to call it in messages
    Returns (H, W, C) float32 as stored: whole numbers are divided by the largest one, palettes are looked
    up, and nothing else is done: no colour conversion, no turning by EXIF, no multiplying by alpha.
    Raises InputError where that cannot be had, and for more than 16384 x 16384 pixels.
    """
    suffix = _suffix(data, name)
    if suffix == ".png":
        _check_png(data, name)
    with tempfile.TemporaryDirectory(prefix="aobake-") as folder:
        path = Path(folder, f"image{suffix}")
        path.write_bytes(data)
        return _read(path, name)


def encode(
    pixels: Pixels, kind: Kind, encoding: Encoding | None = None, *, srgb: bool = False
) -> bytes:
    """An image file that holds these pixels; the same bytes for the same pixels.

    pixels : (H, W) or (H, W, 1 to 4) float32. For whole numbers (8, 16) they are clipped to [0, 1], and what
        is not a number becomes 0
    encoding : one of ENCODINGS[kind]; None: the first of them. 8 bits are dithered, so that a slow gradient
        shows no bands: a value between two steps becomes one or the other, by its place in the image, and
        the mean stays; a value that is a step stays everywhere
    srgb : whether a PNG says that it is sRGB; else it says nothing, as data should
    Raises OutputError where the kind cannot hold the encoding.
    Source of the dither: M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018 (R2).
    """
    encoding = ENCODINGS[kind][0] if encoding is None else encoding
    if encoding not in ENCODINGS[kind]:
        held = ", ".join(ENCODINGS[kind])
        raise OutputError(
            f"{kind.upper()} cannot hold the encoding {encoding!r}. It holds: {held}."
        )
    stack = pixels[:, :, np.newaxis] if pixels.ndim == 2 else pixels
    if stack.ndim != 3 or 0 in stack.shape or stack.shape[2] > 4:
        raise OutputError(f"pixels have the shape {pixels.shape}; (H, W, 1 to 4) is needed.")
    with tempfile.TemporaryDirectory(prefix="aobake-") as folder:
        path = Path(folder, f"image.{kind}")
        _write(path, stack, encoding)
        data = read_bytes(path)
    return _plain_png(data, keep_srgb=srgb) if kind == "png" else data


def fill_holes(values: Pixels, covered: NDArray[np.bool_]) -> Pixels:
    """Values everywhere, continued smoothly from where they are known (push-pull).

    values : (H, W, C) float32; covered : (H, W) bool, where they count; there they stay as they are
    Returns (H, W, C) float32; where nothing is covered, the values unchanged. It takes about ten times the
    memory of the values.
    """
    if covered.all() or not covered.any():
        return values.copy()
    known = covered[:, :, np.newaxis]
    weighted = np.concatenate([np.where(known, values, 0.0), known], axis=2, dtype=np.float32)
    image = oiio.ImageBuf(weighted)
    image.specmod().alpha_channel = values.shape[2]
    filled = _pixels(oiio.ImageBufAlgo.fillholes_pushpull(image))
    return np.where(known, values, filled[:, :, :-1])


def resized(pixels: Pixels, width: int, height: int) -> Pixels:
    """Pixels (H, W, C) float32 at another size, never beyond their own range.

    By whole factors down each pixel is the mean of those that it replaces, as in a chain of mip levels; else
    they are weighted by a triangle as wide as a pixel of the coarser of the two images.
    """
    down = pixels.shape[0] % height == 0 and pixels.shape[1] % width == 0
    image = oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32))
    size = oiio.ROI(0, width, 0, height, 0, 1, 0, pixels.shape[2])
    filtered = oiio.ImageBufAlgo.resize(image, "box" if down else "triangle", 0.0, size)
    return _pixels(filtered)


def text_size(text: str, size_px: int) -> tuple[int, int]:
    """Width of a line of text, and height of any line, in pixels."""
    line = _text_box(TALLEST, size_px)
    return _text_box(text, size_px).xend if text else 0, line.yend - line.ybegin


def with_text(
    pixels: Pixels, text: str, x_px: int, y_px: int, size_px: int, color: tuple[float, ...]
) -> Pixels:
    """Pixels (H, W, 3 or 4) float32 with a line of text over them.

    x_px, y_px : the left end and the top of the line, whose box is text_size(text, size_px)
    color : as many numbers as pixels have channels
    Letters beyond the image are cut off. Raises EngineError where no font is found.
    """
    image = oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32))
    baseline = y_px - _text_box(TALLEST, size_px).ybegin
    drawn = oiio.ImageBufAlgo.render_text(
        image, x_px, baseline, text, size_px, _font(), tuple(map(float, color))
    )
    if not drawn:
        raise EngineError(_no_text(image.geterror()))
    return _pixels(image)


def _suffix(data: bytes, name: str) -> str:
    for signature, suffix in SIGNATURES:
        if data.startswith(signature):
            return suffix
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return ".webp"
    if Path(name).suffix.lower() == ".tga":  # has no signature
        return ".tga"
    found = "a KTX texture" if data[1:4] == b"KTX" else "no image of a known kind"
    raise InputError(f"{name}: this is {found}. Convert it to PNG, JPEG, WebP, TIFF or EXR.")


def _check_png(data: bytes, name: str) -> None:
    """Refuse a damaged PNG before libpng meets it, which would write to the terminal by itself."""
    for kind, content, check in _png_chunks(data):
        if zlib.crc32(kind + content) != check:
            raise InputError(f"{name}: it is damaged in its {kind!r} chunk. Export the image anew.")
        if kind == b"IEND":
            return
    raise InputError(f"{name}: it ends in the middle. Export the image anew.")


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes, int]]:
    """Type, content and checksum of each chunk that is whole."""
    at = 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        end = at + 12 + length
        if end > len(data):
            return
        yield (
            data[at + 4 : at + 8],
            data[at + 8 : end - 4],
            struct.unpack_from(">I", data, end - 4)[0],
        )
        at = end


def _read(path: Path, name: str) -> Pixels:
    as_stored = oiio.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)
    image = oiio.ImageInput.open(str(path), as_stored)
    if image is None:
        raise InputError(_unreadable(name, oiio.geterror()))
    try:
        spec = image.spec()
        if spec.width * spec.height > MOST_PIXELS:
            raise InputError(
                f"{name}: it has {spec.width} x {spec.height} pixels, more than 16384 x 16384. Make it smaller."
            )
        pixels = image.read_image("float")
        if pixels is None:
            raise InputError(_unreadable(name, image.geterror()))
    except MemoryError as error:
        raise InputError(f"{name}: it does not fit into memory. Make it smaller.") from error
    finally:
        image.close()
    return np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)


def _unreadable(name: str, reason: str) -> str:
    first = (reason.strip().splitlines() or ["no reason is given"])[0]
    return f"{name}: the image cannot be read ({first.rstrip('.')}). Export it anew, as PNG."


def _write(path: Path, pixels: Pixels, encoding: Encoding) -> None:
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, OIIO_NAMES[encoding])
    spec.attribute("DateTime", "")  # else the hour of writing
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("png:compressionLevel", PNG_LEVEL)
    spec.attribute("png:filter", PNG_FILTER_AVERAGE)
    halves_in_tiff = oiio.get_int_attribute("tiff:half")
    oiio.attribute("tiff:half", 1)  # else they are widened to 32 bits
    image = oiio.ImageOutput.create(str(path))
    if image is None:
        raise OutputError(f"an image cannot be encoded ({oiio.geterror().strip()}).")
    try:
        good = image.open(str(path), spec)
        for top in range(0, height if good else 0, BAND):
            rows = _stored(pixels[top : top + BAND], encoding, top)
            good = good and image.write_scanlines(top, top + len(rows), 0, rows)
        if not (image.close() and good):
            raise OutputError(f"an image cannot be encoded ({image.geterror().strip()}).")
    finally:
        oiio.attribute("tiff:half", halves_in_tiff)


def _stored(rows: Pixels, encoding: Encoding, top: int) -> NDArray[np.generic]:
    """Rows of the image, from number `top` on, as they are to be written."""
    if encoding in ("half", "float"):
        return np.ascontiguousarray(rows, np.float32)
    scaled = np.clip(np.nan_to_num(rows, nan=0.0), 0.0, 1.0).astype(np.float64)
    if encoding == "16":
        return np.rint(scaled * 65535.0).astype(np.uint16)
    scaled *= 255.0
    scaled += _dither(len(rows), rows.shape[1], top)[:, :, np.newaxis]
    return scaled.astype(np.uint8)


def _dither(height: int, width: int, top: int) -> NDArray[np.float64]:
    """Evenly spread numbers in (0, 1) for a band of the image: what to add before rounding down."""
    x = np.arange(width) * 0.7548776662466927
    y = np.arange(top, top + height) * 0.5698402909980532
    phase = (y[:, np.newaxis] + x) % 1.0
    triangle = 1.0 - np.abs(2.0 * phase - 1.0)
    # Off 0 and 1 by more than the rounding of a float32, so that a value on a step stays there.
    return (np.minimum(np.floor(triangle * 4096.0), 4095.0) + 0.5) / 4096.0


def _plain_png(data: bytes, *, keep_srgb: bool) -> bytes:
    """A PNG without what OpenImageIO adds: gamma and primaries, empty EXIF, an offset of zero."""
    kept = {b"IHDR", b"IDAT", b"IEND"} | ({b"sRGB"} if keep_srgb else set())
    pieces = [data[:8]]
    for kind, content, check in _png_chunks(data):
        if kind in kept:
            pieces += [struct.pack(">I", len(content)), kind, content, struct.pack(">I", check)]
    return b"".join(pieces)


def _pixels(image: oiio.ImageBuf) -> Pixels:
    pixels = image.get_pixels("float")
    if pixels is None or image.has_error:
        raise EngineError(f"OpenImageIO refused its work ({image.geterror().strip()}).")
    return np.asarray(pixels, np.float32)


@functools.cache
def _font() -> str:
    """The font that OpenImageIO's wheels carry; else its name, which is looked for where fonts lie."""
    carried = Path(oiio.__file__).parent / "share/fonts/OpenImageIO/DroidSans.ttf"
    return str(carried) if carried.is_file() else "DroidSans"


def _text_box(text: str, size_px: int) -> oiio.ROI:
    """Where a text comes to lie whose baseline begins at (0, 0)."""
    box = oiio.ImageBufAlgo.text_size(text, size_px, _font())
    if not box.defined:
        raise EngineError(_no_text(oiio.geterror()))
    return box


def _no_text(reason: str) -> str:
    return (
        f"no text can be drawn ({reason.strip() or 'no font was found'}). "
        "Install OpenImageIO from PyPI, whose wheels carry fonts."
    )

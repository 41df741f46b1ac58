"""Denoising of a page, chart by chart: the one file that imports pyoidn (Open Image Denoise).

A chart is denoised in a cut-out that holds nothing but its own texels, continued outwards, so that no
chart depends on what lies beside it on the page. Small cut-outs cost no more per texel than large ones.

What was measured, as root mean square errors of a page of 66 charts on a bumpy torus, against 1,024 rays:

    rays                                        16      32      64     256
    as traced                               0.0441  0.0262  0.0158  0.0059
    guided by normals, kept near the error  0.0156  0.0115  0.0087  0.0050    this one, chart by chart
    guided by nothing                       0.0169  0.0123  0.0090  0.0050
    positions in the place of albedo        0.0153  0.0114  0.0087  0.0051
    the filter for lightmaps (RTLightmap)   0.0160  0.0120  0.0091  0.0051
    the large network (HDR, high quality)   0.0133  0.0101  0.0078  0.0047    2.5 times the seconds

The last four are of the whole page at once. Twice the rays gain more than the large network does in the
same time.

What the network would change is noise and detail together. Its square is what it takes away of noise and what it
spoils, and the noise is known: so around each texel it counts by the share that is noise (C. Stein, 1956). The
error against that of as many rays without denoising, on 192 x 192 texels of 64 and of 256 rays:

                                 demo hall       a house         a figure        a scan          a soft body
    within two standard errors   0.955  1.123    1.136  1.281    1.022  1.248    0.768  1.000    0.572  0.787
    within one                   0.924  1.018    1.002  1.072    0.917  1.039    0.777  0.967    0.609  0.797
    the share of each chart      0.930  1.005    0.983  1.017    0.931  0.995    0.768  1.000    0.572  0.787
    of 17 x 17 texels            0.929  1.005    0.974  1.016    0.915  0.990    0.768  0.996    0.572  0.787
    of 9 x 9 texels              0.925  1.001    0.966  1.010    0.901  0.975    0.768  0.989    0.572  0.787
    of 5 x 5 texels              0.923  0.996    0.956  1.001    0.884  0.961    0.768  0.984    0.572  0.787    this
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.gutter import nearest_covered
from aobake.atlas.page_kernels import chart_boxes
from aobake.errors import EngineError

if TYPE_CHECKING:
    import pyoidn

__all__ = ["available", "check_denoiser", "denoised"]

Float32Array = NDArray[np.float32]
ScalarT = TypeVar("ScalarT", bound=np.generic)
Box = tuple[slice, slice]  # rows and columns

# Texels around a cut-out, each a copy of the chart's nearest one. None make the rim worse (the network is
# off by up to 0.04 there), more are taken for stripes: 0.0118 with 0, 0.0115 with 3, 0.0132 with 16.
MARGIN = 3
BLOCK = 1024  # larger charts are denoised in blocks, so that memory stays bounded, which overlap by the next;
CONTEXT = 64  # both are whole in the network's coarsest texels, 16 wide, and what is farther away weighs 1e-5
FEWEST_TEXELS = 64  # a chart as small as 8 x 8 has nothing to smooth
MOST_ERRORS = 2.0  # standard errors by which a value is moved at most
SAME = 2  # texels around one that has their very value: there is no noise to take away
AROUND = 2  # texels around one, over which what is changed is compared with the noise
TINY = 1e-30  # nothing has changed


def available() -> bool:
    """Whether Open Image Denoise is installed."""
    return importlib.util.find_spec("pyoidn") is not None


def check_denoiser() -> None:
    """Raise EngineError, before a long bake, where Open Image Denoise is missing or cannot be loaded."""
    with _device(1):
        pass


def denoised(
    values: Float32Array,
    error: Float32Array,
    chart: NDArray[np.int32],
    normal: Float32Array | None,
    *,
    threads: int | None = None,
) -> Float32Array:
    """A page with less noise; the same bytes for any number of threads.

    values : (H, W) float32 in [0, 1]; error : (H, W) float32, their standard errors
    chart : (H, W) int32, the chart of each texel, -1: none
    normal : (H, W, 3) float32 unit vectors, which guide the filter; or None
    threads : None: one per processor
    Returns (H, W) float32. No value moves by more than twice its standard error, so that a converged page
    stays as it is, nor by more than noise explains around it. Charts of a few texels stay as well, and values
    that all their neighbours share.
    Raises EngineError where Open Image Denoise is missing or refuses its work.
    Source: the "RT" filter of Open Image Denoise 2 (A. Afra), for values in [0, 1] and guides without noise.
    """
    result = values.copy()
    with _device(threads) as device:
        for number, core, window in _cut_outs(chart):
            own = _cut(chart, window, -1) == number
            inner = _within(core, window)
            mine = own[inner]
            if not mine.any():  # a block that the chart goes around
                continue
            nearest = nearest_covered(own, sum(own.shape))
            noisy = _cut(values, window, 0).reshape(-1)[nearest]
            guide = None if normal is None else _cut(normal, window, 0).reshape(-1, 3)[nearest]
            noise = np.where(own & ~_uniform(noisy), _cut(error, window, 0), np.float32(0.0))
            moved = noisy + _explained(_smooth(device, noisy, guide) - noisy, noise)
            result[core][mine] = moved[inner][mine]
    return result


def _cut_outs(chart: NDArray[np.int32]) -> Iterator[tuple[int, Box, Box]]:
    """The number of each chart, a block of it, and the cut-out to denoise that in, maybe beyond the page."""
    count = int(chart.max(initial=-1)) + 1
    boxes, area = np.zeros((count, 4), np.int32), np.zeros(count, np.int64)
    chart_boxes(chart, boxes, area)
    for number in np.flatnonzero(area >= FEWEST_TEXELS).tolist():
        top, bottom, left, right = boxes[number].tolist()
        for rows, rows_around in _blocks(top, bottom + 1):
            for columns, columns_around in _blocks(left, right + 1):
                yield number, (rows, columns), (rows_around, columns_around)


def _blocks(start: int, stop: int) -> Iterator[tuple[slice, slice]]:
    """Blocks of a range, each with the range that it is denoised in."""
    begin, end = start - MARGIN, stop + MARGIN
    for first in range(begin, end, BLOCK):
        core = slice(max(first, start), min(first + BLOCK, stop))
        if core.start < core.stop:
            yield core, slice(max(first - CONTEXT, begin), min(first + BLOCK + CONTEXT, end))


def _cut(page: NDArray[ScalarT], window: Box, beyond: int) -> NDArray[ScalarT]:
    """A copy of a window of a page (H, W, ...), with `beyond` where there is no page."""
    shape = (*(part.stop - part.start for part in window), *page.shape[2:])
    cut = np.full(shape, beyond, page.dtype)
    on_page = (
        slice(max(window[0].start, 0), min(window[0].stop, page.shape[0])),
        slice(max(window[1].start, 0), min(window[1].stop, page.shape[1])),
    )
    cut[_within(on_page, window)] = page[on_page]
    return cut


def _within(inner: Box, outer: Box) -> Box:
    """Where one box lies in another one."""
    rows, columns = (
        slice(part.start - around.start, part.stop - around.start)
        for part, around in zip(inner, outer, strict=True)
    )
    return rows, columns


def _explained(change: Float32Array, noise: Float32Array) -> Float32Array:
    """(H, W) the part of a change that noise explains. noise : standard errors, 0 where nothing is to change."""
    change = np.where(noise > 0.0, change, np.float32(0.0))
    share = _around(np.square(noise)) / np.maximum(_around(np.square(change)), TINY)
    most = MOST_ERRORS * noise
    return np.asarray(np.clip(change * np.minimum(share, 1.0), -most, most), np.float32)


def _around(image: Float32Array) -> NDArray[np.float64]:
    """(H, W) sums over the texels around each."""
    sums = np.pad(image.astype(np.float64), AROUND)
    for axis in (0, 1):
        sums = np.lib.stride_tricks.sliding_window_view(sums, 2 * AROUND + 1, axis).sum(axis=-1)
    return np.asarray(sums)


def _uniform(image: Float32Array) -> NDArray[np.bool_]:
    """(H, W) bool: where all texels around have the same value."""
    lowest = highest = np.pad(image, SAME, mode="edge")
    for axis in (0, 1):
        lowest = np.lib.stride_tricks.sliding_window_view(lowest, 2 * SAME + 1, axis).min(axis=-1)
        highest = np.lib.stride_tricks.sliding_window_view(highest, 2 * SAME + 1, axis).max(axis=-1)
    return np.asarray(lowest == highest)


@contextmanager
def _device(threads: int | None) -> Iterator[pyoidn.Device]:
    try:
        import pyoidn
    except ImportError as error:
        raise EngineError(
            "denoising needs Open Image Denoise, which is not installed. "
            "Install it (pip install 'aobake[denoise]'), or leave denoising off."
        ) from error
    try:
        device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    except OSError as error:
        raise EngineError(
            f"Open Image Denoise cannot be loaded ({error}). Install it anew."
        ) from error
    try:
        if threads is not None:
            device.set_int("numThreads", threads)
        device.commit()
        _check(device)
        yield device
    finally:
        device.release()


def _smooth(device: pyoidn.Device, noisy: Float32Array, guide: Float32Array | None) -> Float32Array:
    """What the network makes of an image (H, W), guided by normals (H, W, 3) or by nothing."""
    import pyoidn

    smooth, white = np.empty_like(noisy), np.ones_like(noisy)
    with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as network:
        network.set_image("color", noisy, pyoidn.OIDN_FORMAT_FLOAT)
        if guide is not None:
            network.set_image("albedo", white, pyoidn.OIDN_FORMAT_FLOAT)
            network.set_image("normal", guide, pyoidn.OIDN_FORMAT_FLOAT3)
            network.set_bool("cleanAux", True)
        network.set_image("output", smooth, pyoidn.OIDN_FORMAT_FLOAT)
        network.set_quality(pyoidn.OIDN_QUALITY_BALANCED)
        network.commit()
        network.execute()
        _check(device)
    return smooth


def _check(device: pyoidn.Device) -> None:
    message = device.get_error()
    if message is not None:
        raise EngineError(f"Open Image Denoise refused its work ({message.rstrip('.')}).")

"""The plots of a study, as bytes of SVG and PNG. The one file that imports matplotlib."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aobake.errors import EngineError
from aobake.study.curves import Curve, Study, pareto

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["check_plots", "picture_png", "plots"]

WIDTH, HEIGHT = 7.2, 4.6  # inches
COLORS = ("#1f5f8b", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#3a7ca5", "#7f4f24", "#555555")
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "svg.hashsalt": "aobake",  # the same identifiers in every run
    "svg.fonttype": "none",
}


def check_plots() -> None:
    """Raise EngineError now, not after the study, where matplotlib is missing."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise EngineError(
            "a study draws plots with matplotlib, which is missing. "
            'Install it: pip install "aobake[plot]".'
        ) from error


def plots(study: Study) -> dict[str, bytes]:
    """File name -> content: each plot as SVG and PNG."""
    check_plots()
    import matplotlib as mpl

    ways = study.ways
    sets = [curve for curve in study.curves if curve.kind == "directions"]
    found: dict[str, bytes] = {}
    with mpl.rc_context(STYLE):
        figures = {
            "error-rays": _curves(ways, "rays", "rays per point", study),
            "error-time": _curves(ways, "seconds", "seconds", study),
            "honesty": _honesty(ways),
        }
        if study.what == "vertices":
            figures["directions"] = _curves(sets, "rays", "rays per point")
            figures["methods"] = _curves(study.surface, "rays", "rays per vertex")
        for name, figure in figures.items():
            for kind in ("svg", "png"):
                found[f"{name}.{kind}"] = _bytes(figure, kind)
    return found


def picture_png(pixels: NDArray[np.float32]) -> bytes:
    """A PNG of (H, W, 3) values in [0, 1]."""
    check_plots()
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, np.clip(pixels, 0.0, 1.0), format="png", metadata={"Software": "aobake"})
    return stream.getvalue()


def _figure(x: str, y: str) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure as New
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = New(figsize=(WIDTH, HEIGHT))
    axes = figure.add_axes((0.11, 0.12, 0.87, 0.86))
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        # Plain numbers; powers of ten are typeset, which takes ten times as long as all the rest.
        axis.set_major_formatter(FuncFormatter(_plain))
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


def _plain(value: float, _: int) -> str:
    return f"{value:g}"


def _curves(
    curves: Sequence[Curve], measure: str, label: str, front_of: Study | None = None
) -> Figure:
    """Error over rays or seconds, log-log, with slopes and the band of single seeds."""
    figure, axes = _figure(label, "root mean square error")
    for curve, color in zip(curves, COLORS, strict=False):
        x = [getattr(level, measure) for level in curve.levels]
        slope = "" if curve.slope is None else f", slope {curve.slope:.2f}"
        y = [level.rmse for level in curve.levels]
        line = "o--" if curve.denoised else "o-"
        axes.plot(x, y, line, color=color, ms=3.5, lw=1.4, label=f"{curve.name}{slope}")
        low = [level.rmse_least for level in curve.levels]
        high = [level.rmse_most for level in curve.levels]
        axes.fill_between(x, low, high, color=color, alpha=0.2, lw=0)
    if front_of is not None:
        front = [level for _, level in pareto(curves)]
        axes.plot(
            [getattr(level, measure) for level in front],
            [level.rmse for level in front],
            "o",
            color="none",
            markeredgecolor="#222222",
            ms=8,
            label="Pareto front (by rays)",
        )
    if curves:
        axes.legend(frameon=False, fontsize=9)
    return figure


def _honesty(curves: Sequence[Curve]) -> Figure:
    """What was reported over what was true: on the diagonal the error bars are honest."""
    figure, axes = _figure("true root mean square error", "reported standard error, rms")
    for curve, color in zip(curves, COLORS, strict=False):
        x = [level.rmse for level in curve.levels]
        axes.plot(
            x, [v.reported for v in curve.levels], "o-", color=color, ms=3.5, label=curve.name
        )
    ends = np.array(axes.get_xlim())
    axes.plot(ends, ends, color="#222222", lw=0.8, label="equal")
    axes.plot(ends, 1.5 * ends, color="#222222", lw=0.8, ls=":", label="1.5 times too wide")
    axes.legend(frameon=False, fontsize=9)
    return figure


def _bytes(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    figure.savefig(stream, format=kind, dpi=110, metadata=metadata)
    return stream.getvalue()

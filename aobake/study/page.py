"""The page of a study: one HTML file with everything in it."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.study.curves import Curve, Level, Study, needed, pareto
from aobake.study.pictures import ERROR_SHOWN, Picture
from aobake.study.plots import picture_png
from aobake.study.summary import summary

__all__ = ["page"]

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .8rem .15rem 0; text-align: right; border-bottom: 1px solid #eee; }
th:first-child, td:first-child, .facts td { text-align: left; }
svg { max-width: 100%; height: auto; }
.row { display: flex; gap: .6rem; } figure { margin: 0 0 .6rem; } img { width: 100%; height: auto; }
figcaption { font-size: .85rem; color: #555; } .lead { font-size: 1.1rem; }
"""


def page(study: Study, drawings: Mapping[str, bytes], pictures: Sequence[Sequence[Picture]]) -> str:
    """The page as text.

    drawings : of plots.plots; pictures : rows of them
    """
    first, second = summary(study)
    name = html.escape(study.asset)
    parts = [
        f"<h1>What accuracy costs on {name}</h1>",
        f'<p class="lead">{html.escape(first)}.<br>{html.escape(second)}.</p>',
        f"<p>{html.escape(_measured(study))}</p>",
        _section(
            "Error over rays",
            drawings["error-rays.svg"],
            "Bands reach from the best to the worst seed. A tolerance spends rays where they are needed: each "
            "point to the same error, or (rms) where a ray takes away most. Rings mark the Pareto front.",
        ),
        _section("Error over time", drawings["error-time.svg"], "The same, by the clock."),
        _denoiser(study),
        "<h2>All levels</h2>",
        _table(study.ways),
        _section("Is the reported error honest?", drawings["honesty.svg"], _honesty(study)),
        _directions(drawings) if study.what == "vertices" else "",
        _methods(study, drawings),
        _pictures(pictures),
        _facts(study),
    ]
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{name}: accuracy and time</title>'
        f"<style>{STYLE}</style>\n{body}\n</html>\n"
    )


def _measured(study: Study) -> str:
    """What errors and seconds mean here."""
    against = f"Errors are differences from {study.reference_rays:,} rays"
    if study.what == "vertices":
        return (
            f"{against}, at {study.points:,} of its {study.whole:,} vertices. Seconds are those of tracing the "
            "whole asset, medians of repeats with different seeds."
        )
    return (
        f"{against} a texel without denoising, at the {study.points:,} texels of a texture of "
        f"{study.facts['texture']} that surfaces lie on, before rims are lit and seams joined. Seconds are those "
        "of texels, rays, denoising, rims, seams and gutters, medians of repeats with different seeds; what is "
        "done once for an asset, as unwrapping, is not in them."
    )


def _honesty(study: Study) -> str:
    """What the plot of reported over true errors shows."""
    text = "The standard error that a bake reports against the true one; on the line they agree."
    if study.denoised is not None:
        text += " That of a denoised bake is the one of its rays: what the denoiser takes away comes on top."
    return text


def _denoiser(study: Study) -> str:
    """What the denoiser is worth at each number of rays; why it was not compared, for texels without."""
    if study.what != "texels":
        return ""
    title = "<h2>What denoising is worth</h2>\n"
    if study.denoised is None:
        return f"{title}<p>It was not measured: {html.escape(str(study.facts['denoiser']))}.</p>"
    rows = [
        "<tr><th>rays</th><th>RMSE</th><th>denoised</th><th>ratio</th><th>rays for it without</th>"
        "<th>seconds</th><th>denoised</th></tr>"
    ]
    for plain, smooth in zip(study.fixed.levels, study.denoised.levels, strict=True):
        same = needed(study.fixed, smooth.rmse)
        ratio = smooth.rmse / plain.rmse if plain.rmse > 0.0 else 1.0
        rows.append(
            f"<tr><td>{plain.setting}</td><td>{plain.rmse:.5f}</td><td>{smooth.rmse:.5f}</td>"
            f"<td>{ratio:.2f}</td><td>{'' if same is None else f'{same[0]:.0f}'}</td>"
            f"<td>{plain.seconds:.2f}</td><td>{smooth.seconds:.2f}</td></tr>"
        )
    text = (
        "The same rays with and without it. It moves no value by more than twice its standard error, so that it "
        "changes ever less as rays grow in number. Where the ratio nears 1 it costs its seconds for nothing."
    )
    return f"{title}<p>{text}</p>\n<table>" + "\n".join(rows) + "</table>"


def _directions(drawings: Mapping[str, bytes]) -> str:
    return _section(
        "Sets of directions",
        drawings["directions.svg"],
        "How directions are chosen, at equal rays. Bakes use the Vogel spiral for a fixed number, and the "
        "growing spiral towards a tolerance.",
    )


def _section(title: str, drawing: bytes, text: str) -> str:
    svg = drawing.decode("utf-8")
    return f"<h2>{title}</h2>\n<p>{text}</p>\n{svg[svg.index('<svg') :]}"


def _table(curves: Sequence[Curve]) -> str:
    front = {(name, level.setting) for name, level in pareto(curves)}
    rows = [
        "<tr><th>setting</th><th>rays</th><th>seconds</th><th>RMSE</th><th>99 %</th><th>max</th>"
        "<th>within 2 SE</th><th>front</th></tr>"
    ]
    rows += [
        f"<tr><td>{_said(curve, level)}</td><td>{level.rays:.0f}</td><td>{level.seconds:.2f}</td>"
        f"<td>{level.rmse:.5f}</td><td>{level.p99:.4f}</td><td>{level.max:.4f}</td>"
        f"<td>{level.within_2:.1%}</td><td>{'yes' if (curve.name, level.setting) in front else ''}</td></tr>"
        for curve in curves
        for level in curve.levels
    ]
    return "<table>" + "\n".join(rows) + "</table>"


def _said(curve: Curve, level: Level) -> str:
    """What was asked for; a tolerance says its form by itself."""
    if curve.kind != "tolerance":
        return f"{curve.name} {level.setting}"
    return f"tolerance {level.setting}" + (", denoised" if curve.denoised else "")


def _methods(study: Study, drawings: Mapping[str, bytes]) -> str:
    if not study.surface:
        return ""
    return _section(
        "At the vertices, or fitted",
        drawings["methods.svg"],
        "The error of what is interpolated over the triangles, against a dense bake of the surface. More rays "
        "at the vertices (point) cannot help where triangles are large; fitted values (lsq) can.",
    )


def _pictures(rows: Sequence[Sequence[Picture]]) -> str:
    if not rows:
        return ""
    figures = [
        '<div class="row">'
        + "".join(
            f"<figure>{_image(picture.pixels, picture.caption)}"
            f"<figcaption>{html.escape(picture.caption)}</figcaption></figure>"
            for picture in row
        )
        + "</div>"
        for row in rows
    ]
    text = f"<p>Errors from white, exact, to dark red, {ERROR_SHOWN:g} and more.</p>\n"
    return "<h2>How it looks</h2>\n" + text + "\n".join(figures)


def _image(pixels: NDArray[np.float32], alt: str) -> str:
    data = base64.b64encode(picture_png(pixels)).decode("ascii")
    return f'<img alt="{alt}" src="data:image/png;base64,{data}">'


def _facts(study: Study) -> str:
    spread = max(
        (v.seconds_most / v.seconds_least for v in study.fixed.levels if v.seconds_least > 0.0),
        default=1.0,
    )
    facts = {**study.facts, "spread of times, most over least": spread}
    rows = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(_plain(fact))}</td></tr>"
        for name, fact in facts.items()
    )
    return f'<h2>Where it was measured</h2>\n<table class="facts">{rows}</table>'


def _plain(fact: object) -> str:
    """A fact as people write it."""
    if isinstance(fact, Mapping):
        return ", ".join(f"{name} {value}" for name, value in fact.items())
    return f"{fact:.2f}" if isinstance(fact, float) else str(fact)

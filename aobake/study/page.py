"""The page of a study: one HTML file with everything in it."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.study.curves import Curve, Level, Study, needed, pareto
from aobake.study.pictures import LevelPictures
from aobake.study.plots import picture_png

__all__ = ["page", "summary"]

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .8rem .15rem 0; text-align: right; border-bottom: 1px solid #eee; }
th:first-child, td:first-child, .facts td { text-align: left; }
svg { max-width: 100%; height: auto; } figure { display: inline-block; margin: .3rem; }
figcaption { font-size: .85rem; color: #555; } .lead { font-size: 1.1rem; }
"""


def summary(study: Study) -> tuple[str, str]:
    """Two lines for a terminal: what an error of 0.01 costs and how that grows; what qualities cost."""
    fixed = study.fixed
    at = needed(fixed, 0.01)
    if at is None:
        first = "RMSE 0.01 is outside of what was measured"
    else:
        first = f"for RMSE 0.01: {at[0]:.0f} rays, {at[1]:.2g} s"
    if fixed.slope is not None:
        first += f"; each halving of the error costs {2.0 ** (-1.0 / fixed.slope):.1f}x"
    named = [
        (level.setting.partition("(")[2].rstrip(")"), level)
        for curve in study.curves
        for level in curve.levels
        if "(" in level.setting
    ]
    told = [f"{name} {v.rays:.0f} rays, {v.seconds:.2g} s, RMSE {v.rmse:.4f}" for name, v in named]
    return first, "quality: " + "; ".join(told)


def page(study: Study, drawings: Mapping[str, bytes], pictures: Sequence[LevelPictures]) -> str:
    """The page as text.

    drawings : of plots.plots
    """
    first, second = summary(study)
    name = html.escape(study.asset)
    points = f"{study.points:,} of its {study.vertices:,} vertices"
    parts = [
        f"<h1>What accuracy costs on {name}</h1>",
        f'<p class="lead">{html.escape(first)}.<br>{html.escape(second)}.</p>',
        f"<p>Errors are differences from {study.reference_rays:,} rays, at {points}. Seconds are those of "
        "tracing the whole asset, medians of repeats with different seeds.</p>",
        _section(
            "Error over rays",
            drawings["error-rays.svg"],
            "Bands reach from the best to the worst seed. A tolerance spends rays where they are needed: each "
            "point to the same error, or (rms) where a ray takes away most. Rings mark the Pareto front.",
        ),
        _section("Error over time", drawings["error-time.svg"], "The same, by the clock."),
        _table([curve for curve in study.curves if curve.kind != "directions"]),
        _section(
            "Is the reported error honest?",
            drawings["honesty.svg"],
            "The standard error that a bake reports against the true one; on the line they agree.",
        ),
        _section(
            "Sets of directions",
            drawings["directions.svg"],
            "How directions are chosen, at equal rays. Bakes use the Vogel spiral for a fixed number, and the "
            "growing spiral towards a tolerance.",
        ),
        _methods(study, drawings),
        _pictures(pictures),
        _facts(study),
    ]
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{name}: accuracy and time</title>'
        f"<style>{STYLE}</style>\n{body}\n</html>\n"
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
    return f"{curve.kind if curve.kind == 'tolerance' else curve.name} {level.setting}"


def _methods(study: Study, drawings: Mapping[str, bytes]) -> str:
    if not study.surface:
        return ""
    return _section(
        "At the vertices, or fitted",
        drawings["methods.svg"],
        "The error of what is interpolated over the triangles, against a dense bake of the surface. More rays "
        "at the vertices (point) cannot help where triangles are large; fitted values (lsq) can.",
    )


def _pictures(pictures: Sequence[LevelPictures]) -> str:
    if not pictures:
        return ""
    figures = [
        f"<div><figure>{_image(level.occlusion, f'{level.rays} rays')}"
        f"<figcaption>{level.rays:,} rays</figcaption></figure>"
        f"<figure>{_image(level.error, f'error of {level.rays} rays')}"
        "<figcaption>its error; dark red: 0.05 and more</figcaption></figure></div>"
        for level in pictures
    ]
    return "<h2>How it looks</h2>\n" + "\n".join(figures)


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

"""A study in two lines."""

from __future__ import annotations

from aobake.study.curves import Curve, Study, needed

__all__ = ["summary"]

RMSE = 0.01


def summary(study: Study) -> tuple[str, str]:
    """Two lines for a terminal: what an error of 0.01 costs and how that grows; what qualities cost."""
    said = f"for RMSE {RMSE:g}: {_cost(study.fixed)}"
    if study.denoised is not None:
        said += f"; with denoising: {_cost(study.denoised)}"
    if study.fixed.slope is not None:
        said += f"; each halving of the error costs {2.0 ** (-1.0 / study.fixed.slope):.1f}x"
    return said, "quality: " + "; ".join(_qualities(study))


def _cost(curve: Curve) -> str:
    """Rays and seconds for the error; where it lies beyond the levels, what the nearest one tells."""
    found = needed(curve, RMSE)
    if found is not None:
        return f"{found[0]:.0f} rays, {found[1]:.2g} s"
    best = min(curve.levels, key=lambda level: level.rmse)
    if best.rmse > RMSE:
        return f"more than {best.rays:.0f} rays"
    least = min(curve.levels, key=lambda level: level.rays)
    return f"at most {least.rays:.0f} rays, {least.seconds:.2g} s"


def _qualities(study: Study) -> list[str]:
    """What each quality by name takes and comes to, and what it comes to denoised."""
    named = {
        (level.setting, curve.denoised): level
        for curve in study.curves
        for level in curve.levels
        if "(" in level.setting
    }
    told = []
    for (setting, denoised), level in named.items():
        if denoised:
            continue
        name = setting.partition("(")[2].rstrip(")")
        line = f"{name} {level.rays:.0f} rays, {level.seconds:.2g} s, RMSE {level.rmse:.4f}"
        smooth = named.get((setting, True))
        told.append(line if smooth is None else f"{line}, denoised {smooth.rmse:.4f}")
    return told

"""The ways to spend rays that every study measures: fixed numbers, and tolerances in both forms."""

from __future__ import annotations

from dataclasses import replace

from aobake.errors import SettingsError
from aobake.settings import QUALITIES, BakeSettings, ToleranceOf

__all__ = ["FORMS", "fixed", "rays_towards", "refuse_longer", "said", "towards"]

FORMS: tuple[tuple[str, ToleranceOf], ...] = (("tolerance", "each"), ("tolerance rms", "rms"))
"""Each point to a tolerance, and all of them together: the name of the curve, and the setting."""


def fixed(settings: BakeSettings, rays: int, seed: int) -> BakeSettings:
    """The settings with a fixed number of rays."""
    return replace(settings, rays=rays, seed=seed, tolerance=None, quality=None)


def towards(
    settings: BakeSettings, tolerance: float, form: ToleranceOf, most: int, seed: int
) -> BakeSettings:
    """The settings with a tolerance, and at most so many rays a point."""
    return replace(
        settings,
        tolerance=tolerance,
        tolerance_of=form,
        quality=None,
        max_rays=most,
        seed=seed,
    )


def said(tolerance: float, form: ToleranceOf) -> str:
    """A tolerance as it is asked for, with the quality that it stands for."""
    if form == "rms":
        return f"rms:{tolerance:g}"
    names = {value: f" ({name})" for name, value in QUALITIES.items()}
    return f"{tolerance:g}{names.get(tolerance, '')}"


def rays_towards(tolerance: float) -> float:
    """About how many rays a point takes to a tolerance."""
    return float(0.4 * tolerance ** (-4.0 / 3.0))


def refuse_longer(expected: float, limit: float | None, *, quicker: bool) -> None:
    """Raise SettingsError where a study would take longer than its limit.

    expected : seconds; limit : seconds, None: any; quicker : whether there is a quicker study
    """
    if limit is not None and expected > limit:
        cure = ", or make a quick study" if quicker else ""
        raise SettingsError(
            f"the study would take about {expected:.0f} s on this machine, and the time limit is "
            f"{limit:g} s. Raise the time limit{cure}."
        )

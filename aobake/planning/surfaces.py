"""Effects of where values are kept: at vertices, or in the texels of a texture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from aobake.planning.effect import Effect
from aobake.settings import BakeSettings

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene

__all__ = ["texture_effects", "vertex_effects"]

VISIBLE_NOISE = 0.5 / 255  # standard error below half a step of an 8-bit image: nothing to smooth
COARSE = 0.03  # edges over the scene's size from which interpolation errs by more than 0.02 (docs/accuracy.md)
NOISE = 0.28  # standard error of one ray, so to speak: it falls from here as rays^-0.75


def vertex_effects(scene: Scene, settings: BakeSettings) -> Mapping[str, Effect]:
    """name -> Effect, of a bake to vertices."""
    return {"method": _method(scene, settings)}


def texture_effects(scene: Scene, settings: BakeSettings) -> Mapping[str, Effect]:
    """name -> Effect, of a bake to a texture."""
    return {
        "normal_map": _normal_map(scene, settings),
        "blend": _blend(scene, settings),
        "denoise": _denoise(settings),
    }


def _method(scene: Scene, settings: BakeSettings) -> Effect:
    """On where values are fitted to samples inside the triangles."""
    cost = 3.0 * scene.triangles / max(1, scene.vertices)
    if settings.method == "auto" and (settings.bent_normals or settings.mean_distance):
        what = "Bent normals are" if settings.bent_normals else "Mean distances are"
        return Effect(False, f"{what} found at points.", cost)
    if settings.method != "auto":
        return Effect(settings.method == "lsq", f"method is {settings.method}.", cost)
    from aobake.meshes.coarseness import typical_edge

    edge, size = typical_edge(scene)
    limit, what = COARSE * size, f"{COARSE:.0%} of the scene's size"
    if settings.max_distance is not None and settings.max_distance / 5.0 < limit:
        limit, what = settings.max_distance / 5.0, "a fifth of max_distance"
    if edge <= limit:
        return Effect(
            False,
            f"Triangles are about {edge:.3g} long, at most {what}: values at the vertices do.",
            cost,
        )
    return Effect(
        True, f"Triangles are about {edge:.3g} long, over {what}: samples inside decide.", cost
    )


def _normal_map(scene: Scene, settings: BakeSettings) -> Effect:
    mapped = [material.name for material in scene.materials if material.normal_texture is not None]
    if not settings.normal_map:
        there = f", and material {mapped[0]!r} has one" if mapped else ""
        return Effect(False, f"Normal maps were not asked for{there}.")
    if not mapped:
        return Effect(False, "No material has a normal map.")
    return Effect(True, f"The normal map of material {mapped[0]!r} turns its hemispheres.", 1.05)


def _blend(scene: Scene, settings: BakeSettings) -> Effect:
    there = [
        material.name for material in scene.materials if material.occlusion_texture is not None
    ]
    if not there:
        return Effect(False, "No material has an occlusion texture already.")
    if settings.blend == "replace":
        return Effect(False, f"The occlusion texture of material {there[0]!r} is replaced.")
    return Effect(True, f"The occlusion texture of material {there[0]!r} is multiplied in.")


def _denoise(settings: BakeSettings) -> Effect:
    """On where it is asked for, or where noise would show and the denoiser is there.

    Half the error by rays costs 2.5 times their seconds; on large charts the denoiser costs what 60 rays a texel do.
    Where charts turn out to be small, a bake leaves it off after all (planning.denoising).
    """
    from aobake.atlas.denoise import available  # heavy: vertices do without

    if settings.denoise != "auto":
        return Effect(settings.denoise == "on", f"denoise is {settings.denoise}.", 1.2)
    expected = settings.tolerance or NOISE * settings.rays**-0.75
    if expected <= VISIBLE_NOISE:
        return Effect(False, f"A standard error of about {expected:.4f} does not show in 8 bits.")
    if not available():
        return Effect(False, "It would pay, but pyoidn is not installed (aobake[denoise]).")
    return Effect(
        True,
        f"A standard error of about {expected:.4f} costs less to smooth than to trace, on large charts.",
        1.2,
    )

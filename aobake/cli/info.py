"""`aobake info`: what is in an asset; without one, versions and the machine."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from aobake.cli import terminal
from aobake.cli.app import Parameter
from aobake.cli.options import COMMON, SourceOptions

if TYPE_CHECKING:
    from aobake import Scene

__all__ = ["bounds", "info"]

Facts = Mapping[str, object]

MOST_SHOWN = 12  # of a list; --json has all of it


def info(
    input: Path | None = None,
    /,
    *,
    as_json: Annotated[bool, Parameter(name="--json", group=COMMON)] = False,
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    debug: Annotated[bool, Parameter(group=COMMON)] = False,  # noqa: ARG001 - seen by run()
) -> int:
    """Show what is in an asset; without one, versions and the machine.

    Parameters
    ----------
    input:
        The asset to look into.
    as_json:
        Print JSON.
    debug:
        Show where in the program an error arose.
    """
    sections = about_aobake() if input is None else about_asset(input, source)
    if as_json:
        terminal.say(json.dumps(sections, indent=2, ensure_ascii=False, default=str))
        return 0
    shown = [(title, {n: _shown(v) for n, v in facts.items()}) for title, facts in sections.items()]
    terminal.tables([section for section in shown if section[1]])
    return 0


def about_aobake() -> dict[str, Facts]:
    """Versions and the machine, under titles."""
    from aobake import environment

    return {
        "versions": environment.versions(),
        "machine": {
            "system": environment.machine(),
            "processors": environment.processors(),
            "compiled kernels": environment.cache_folder(),
        },
    }


def about_asset(path: Path, source: SourceOptions) -> dict[str, Facts]:
    """What the document holds, what a bake would see of it, and what is wrong with it, under titles."""
    from aobake import load

    scene = load(path, root=source.root, scene=source.scene, pose=source.pose)
    document = scene.source
    facts: Facts = {} if document is None else {"format": document.format, **document.facts()}
    problems = {str(number): text for number, text in enumerate(scene.warnings, 1)}
    return {"file": {"path": str(path), **facts}, "scene": _numbers(scene), "problems": problems}


def _numbers(scene: Scene) -> Facts:
    lowest, highest = bounds(scene)
    return {
        "instances": len(scene.instances),
        "meshes": len(scene.meshes),
        "triangles": scene.triangles,
        "vertices": scene.vertices,
        "lowest corner": lowest,
        "highest corner": highest,
    }


def bounds(scene: Scene) -> tuple[list[float], list[float]]:
    """Lowest and highest corner of all finite vertices, in the scene's space; empty where there are none."""
    import numpy as np

    corners = []
    for instance, mesh in scene.placed():
        finite = mesh.vertices[np.isfinite(mesh.vertices).all(axis=1)]
        if len(finite):
            placed = finite @ instance.transform[:3, :3].T + instance.transform[:3, 3]
            corners += [placed.min(axis=0), placed.max(axis=0)]
    if not corners:
        return [], []
    return np.min(corners, axis=0).tolist(), np.max(corners, axis=0).tolist()


def _shown(value: object) -> str:
    """A value as people read it."""
    match value:
        case bool():
            return "yes" if value else "no"
        case int():
            return f"{value:,}"
        case float():
            return f"{value:.6g}"
        case list() | tuple():
            shown = [_shown(part) for part in value[:MOST_SHOWN]]
            apart = "; " if any(", " in part for part in shown) else ", "
            more = [f"and {len(value) - MOST_SHOWN} more"] if len(value) > MOST_SHOWN else []
            return apart.join([*shown, *more]) or "none"
        case dict():
            return ", ".join(f"{name} {_shown(part)}" for name, part in value.items()) or "none"
        case None | "":
            return "none"
    return str(value)

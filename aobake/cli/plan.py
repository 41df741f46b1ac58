"""`aobake plan`: which effects a bake of an asset would simulate, why, and at what cost."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from aobake.cli import terminal
from aobake.cli.app import Parameter
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import (
    COMMON,
    AtlasFlags,
    ConfigOptions,
    SourceOptions,
    TraceFlags,
    VertexFlags,
)

if TYPE_CHECKING:
    from aobake import Plan
    from aobake.planning.cost import Cost

__all__ = ["plan"]


def plan(  # noqa: PLR0913 - one for each group of flags
    input: Path,
    /,
    *,
    texture: Annotated[bool, Parameter(group=COMMON)] = False,
    as_json: Annotated[bool, Parameter(name="--json", group=COMMON)] = False,
    vertices: VertexFlags = None,
    atlas: AtlasFlags = None,
    trace: TraceFlags = None,
    config: ConfigOptions = ConfigOptions(),  # noqa: B008 - frozen
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    debug: Annotated[bool, Parameter(group=COMMON)] = False,  # noqa: ARG001 - seen by run()
) -> int:
    """Show which effects a bake would simulate, why, and at what cost.

    Takes the flags of vertex and texture. Nothing is written; some points are
    traced, so that seconds are those of this machine.

    Parameters
    ----------
    input:
        The asset that would be baked.
    texture:
        Plan a bake to a texture instead of to vertices.
    as_json:
        Print JSON.
    debug:
        Show where in the program an error arose.
    """
    chosen = config.configured(input, trace, vertices, atlas).bake

    from aobake import load
    from aobake.plan import plan as vertex_plan
    from aobake.plan import texture_plan
    from aobake.planning.cost import estimated

    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
        decided = texture_plan(scene, chosen) if texture else vertex_plan(scene, chosen)
        cost = estimated(decided, scene, chosen, texture=texture)
    if as_json:
        terminal.say(json.dumps(_as_json(decided, cost), indent=2, ensure_ascii=False))
    else:
        terminal.tables([("effects", _lines(decided)), ("estimate", _total(cost))])
    return 0


def _as_json(decided: Plan, cost: Cost) -> dict[str, object]:
    effects = {
        name: {
            "on": effect.on,
            "reason": effect.reason,
            "forced": effect.forced,
            "cost": dataclasses.asdict(cost.effects[name]),
        }
        for name, effect in decided.effects.items()
    }
    total = {key: value for key, value in dataclasses.asdict(cost).items() if key != "effects"}
    return {"effects": effects, "total": total}


def _lines(decided: Plan) -> dict[str, str]:
    """One line for each effect."""
    lines = {}
    for name, effect in decided.effects.items():
        times = f" (x {effect.cost:.2g})" if effect.on and effect.cost != 1.0 else ""
        lines[name] = f"{'on' if effect.on else 'off'}{times}: {effect.reason}"
    return lines


def _total(cost: Cost) -> dict[str, str]:
    stages = ", ".join(f"{stage} {spent:.2f}" for stage, spent in cost.stages.items())
    return {
        "points": f"{cost.points:,}",
        "rays": f"{cost.rays / 1e6:.1f} million",
        "seconds": f"{cost.seconds:.2f} ({stages})",
        "memory": f"{cost.bytes / 2**20:.0f} MiB",
    }

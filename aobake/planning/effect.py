"""An effect, and the plan that it is part of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

__all__ = ["Effect", "Plan"]


@dataclass(frozen=True)
class Effect:
    """One thing that a bake can simulate.

    on : whether it is simulated
    reason : one sentence that says why, or why not
    cost : what it multiplies the seconds of tracing by, when on
    forced : whether it was switched by hand
    """

    on: bool
    reason: str
    cost: float = 1.0
    forced: bool = False


@dataclass(frozen=True)
class Plan:
    """effects : name -> Effect, in the order in which they are explained."""

    effects: Mapping[str, Effect]

    def with_open_sky(self, count: int, points: int) -> Plan:
        """The plan as it turned out: of how many of the points it was found that everything lies below."""
        decided = self.effects["open_sky"]
        if not decided.on:
            return self
        reason = f"{count:,} of {points:,} points have everything below them: 1 without a ray."
        if count == 0:
            reason = (
                "No point was found that everything lies below, or looking for them does not pay."
            )
        return Plan({**self.effects, "open_sky": replace(decided, on=count > 0, reason=reason)})

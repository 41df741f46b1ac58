"""What of a scene can move, and how it stands in the bake."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Motion"]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """What of a scene can move, and how it stands.

    skinned, morphed : the meshes that joints or morph targets bend, as a user would name them
    clips : its animations, likewise
    pose : the clip and the moment in which it stands; None: it stands as it does without any clip
    """

    skinned: tuple[str, ...] = ()
    morphed: tuple[str, ...] = ()
    clips: tuple[str, ...] = ()
    pose: str | None = None

    def __str__(self) -> str:
        """One sentence."""
        if self.pose is not None:
            return f"The scene stands as in {self.pose}."
        bent = tuple(dict.fromkeys((*self.skinned, *self.morphed)))
        ways = (("skinned", self.skinned), ("morphed", self.morphed))
        how = " and ".join(way for way, meshes in ways if meshes)
        if len(bent) > 1:
            return f"{_capital(bent[0])} and {len(bent) - 1} more are {how}; they are baked in their rest pose."
        if bent:
            return f"{_capital(bent[0])} is {how}; it is baked in its rest pose."
        if self.clips:
            return f"{_capital(self.clips[0])} moves nodes; they are baked where they stand without it."
        return "Nothing in the scene moves."


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]

"""What a bake had to pass over, mend or leave in doubt: counted, located, and said in one line each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["EXAMPLES", "Finding", "FindingKind"]

FindingKind = Literal[
    "non-finite",
    "degenerate",
    "reoriented",
    "inward",
    "replaced-normal",
    "no-normal",
    "contact",
    "thin",
    "unresolved",
    "doubtful",
    "enclosed",
]
EXAMPLES = 5  # elements that are named

_SENTENCES: dict[FindingKind, str] = {
    "non-finite": "vertices are not finite; they and their faces were passed over",
    "degenerate": "faces have no area and were passed over",
    "reoriented": "faces were wound against their neighbours and were turned for the bake",
    "inward": "faces make a closed surface that faces inward: a room, or one turned inside out",
    "replaced-normal": "normals are zero or not finite and were computed from the faces",
    "no-normal": "vertices have no normal that could be told and were left open (1)",
    "contact": "points lie where a surface rests on another one; what is hidden there was left out",
    "thin": "points face a gap thinner than float32 resolves there; half of it was kept clear",
    "unresolved": "points lie too far from the others for their detail, even with frames of their own",
    "doubtful": "points have no side that is in front of all the surfaces around them",
    "enclosed": "points lie face to face on another surface and came out as closed (0)",
}


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One kind of trouble in one place.

    kind : what was found
    where : the mesh or instance, as a user would name it
    count : how many elements (vertices, faces or points) it concerns
    examples : the numbers of the first few of them
    """

    kind: FindingKind
    where: str
    count: int
    examples: tuple[int, ...]

    def __str__(self) -> str:
        named = ", ".join(map(str, self.examples))
        more = ", ..." if self.count > len(self.examples) else ""
        return f"{self.where}: {self.count} {_SENTENCES[self.kind]} ({named}{more})."

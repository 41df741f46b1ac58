"""What a bake had to pass over, mend or leave in doubt: counted, located, and said in one line each."""

from __future__ import annotations

import re
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
    "sliver",
    "contact",
    "thin",
    "unresolved",
    "doubtful",
    "enclosed",
    "joined",
    "unreferenced",
    "non-manifold",
    "closed-hole",
]
EXAMPLES = 5  # elements that are named
_CHOICE = re.compile(r"\{(.*?)\|(.*?)\}")

# {one|several}: what is said of one, and of any other number
_SENTENCES: dict[FindingKind, str] = {
    "non-finite": "{vertex is|vertices are} not finite; {its|their} faces were passed over",
    "degenerate": "{face has|faces have} no area and {was|were} passed over",
    "reoriented": "{face was|faces were} wound against {its|their} neighbours and turned for the bake",
    "inward": "{face makes|faces make} a closed surface that faces inward: a room, or one turned inside out",
    "replaced-normal": "{normal is|normals are} zero or not finite and {was|were} computed from the faces",
    "no-normal": "{vertex has|vertices have} no normal that could be told and {was|were} left open (1)",
    "sliver": "{point touches|points touch} faces over 5,000 times as long as wide; single rays may be lost there",
    "contact": "{point lies|points lie} where a surface rests on another one; what is hidden there was left out",
    "thin": "{point faces|points face} a gap or a tip finer than float32 resolves; the values are in doubt",
    "unresolved": "{point has|points have} detail around finer than float32 resolves; the values are in doubt",
    "doubtful": "{point has|points have} no side in front of all that touches there; the values are in doubt",
    "enclosed": "{point lies|points lie} face to face on another surface and came out as closed (0)",
    "joined": "{vertex lies|vertices lie} at the place of another one and {was|were} joined with it to mend the mesh",
    "unreferenced": "{vertex belongs|vertices belong} to no face and {was|were} left open (1)",
    "non-manifold": "{vertex joins|vertices join} more faces than a surface can and {was|were} split to mend the mesh",
    "closed-hole": "{hole was|holes were} closed for the bake",
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
        sentence = _CHOICE.sub(r"\1" if self.count == 1 else r"\2", _SENTENCES[self.kind])
        return f"{self.where}: {self.count} {sentence} ({named}{more})."

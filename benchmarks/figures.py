"""How the pictures of the documents look."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#3a3a3a"
STYLE = {
    "font.family": "DejaVu Sans", "font.size": 9.0, "axes.titlesize": 10.0,
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#9a9a9a",
    "axes.labelcolor": INK, "axes.titlecolor": INK, "text.color": INK, "xtick.color": INK,
    "ytick.color": INK, "axes.grid": True, "grid.color": "#e8e8e8", "axes.axisbelow": True,
    "figure.facecolor": "white", "savefig.facecolor": "white",
}  # fmt: skip


def save(figure: Figure, path: Path, dots_per_inch: int = 110) -> None:
    """Write a figure as a PNG, without the version that would change its bytes."""
    figure.savefig(
        path, dpi=dots_per_inch, metadata={"Software": None}, pil_kwargs={"optimize": True}
    )
    print(f"{path}: {path.stat().st_size / 1024:.0f} KB")

"""What the tests share: small assets that are made on the spot, and the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from aobake.cli import main


@dataclass(frozen=True)
class Ran:
    """How a command ended."""

    status: int
    out: str
    err: str


Run = Callable[..., Ran]


@pytest.fixture
def corner(tmp_path: Path) -> Path:
    """A floor and a wall, each of 6 x 6 squares, as an OBJ file: open above, dark where they meet."""
    n = 6
    lines = [f"v {x / n} 0 {z / n}" for z in range(n + 1) for x in range(n + 1)]
    lines += [f"v {x / n} {y / n} 0" for y in range(n + 1) for x in range(n + 1)]
    for start, up in ((1, 1), ((n + 1) ** 2 + 1, 0)):
        for row in range(n):
            for column in range(n):
                a = start + row * (n + 1) + column
                b, c, d = a + 1, a + n + 2, a + n + 1
                lines.append(f"f {a} {d} {c} {b}" if up else f"f {a} {b} {c} {d}")
    path = tmp_path / "corner.obj"
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a command in this process."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def command(*arguments: object) -> Ran:
        capfd.readouterr()
        status = main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return Ran(status, out, err)

    return command

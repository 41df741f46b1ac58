"""What several tests need besides fixtures: a Python of its own, and what a message must look like."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

__all__ = ["ROOT", "heeds_interrupts", "modules_after", "one_line", "python"]

ROOT = Path(__file__).resolve().parents[1]


def python(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run this Python in a process of its own, without the developer's settings."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": "", "COLUMNS": "80"},
        capture_output=True,
        text=True,
        check=False,
    )


def one_line(text: str, *parts: str) -> bool:
    """Whether a text is a single line that contains all of these."""
    return text.count("\n") == 1 and text.endswith("\n") and all(part in text for part in parts)


def modules_after(code: Sequence[str]) -> set[str]:
    """Top-level modules that are loaded after running `code` in a fresh Python."""
    shown = "import sys; print(' '.join({name.split('.')[0] for name in sys.modules}))"
    done = python("-c", "\n".join([*code, shown]))
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split()[-400:])


def heeds_interrupts() -> None:
    """For preexec_fn: jobs in the background of a shell ignore SIGINT, and so would what they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

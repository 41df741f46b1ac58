"""Ctrl-C where Python cannot act on it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from aobake.cli.leaving import leaving_promptly

DEAF = """
import signal, sys, time
from aobake.cli.leaving import leaving_promptly
signal.signal(signal.SIGINT, lambda *_: None)  # as LLVM drops it
with leaving_promptly():
    print("in", flush=True)
    time.sleep(30)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no POSIX signals")
def test_an_interrupt_that_is_dropped_ends_the_process_all_the_same() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "in\n"
    started = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert err == "aobake: error: interrupted.\n"
    assert time.monotonic() - started < 15.0  # 0.7 s by design; the rest is for busy machines


def test_signals_are_heard_as_before_once_it_is_over() -> None:
    before = signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(before)
    hook = sys.unraisablehook
    with leaving_promptly():
        assert signal.set_wakeup_fd(-1) != before
    assert signal.set_wakeup_fd(before) == before
    assert sys.unraisablehook is hook

"""Ctrl-C that works within a second, also where Python cannot act on it.

A signal reaches Python code only between two of its own instructions: not while LLVM compiles a kernel
(for seconds when a machine bakes for the first time), and inside one of LLVM's callbacks the KeyboardInterrupt
is dropped and the bake would go on. So a thread watches, and ends the process when it lingers.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING

from aobake.cli import terminal

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

__all__ = ["Terminated", "leaving_promptly", "obey_sigterm"]

GRACE_S = 0.7  # in which an interrupted bake ends by itself; it takes 0.1 s
ENDING = {signal.SIGINT, signal.SIGTERM}


class Terminated(KeyboardInterrupt):
    """SIGTERM as an exception, so that half-written files are removed; the default would leave them."""


def obey_sigterm() -> None:
    """Raise Terminated in the main thread when the process is asked to end."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminated)


@contextlib.contextmanager
def leaving_promptly() -> Iterator[None]:
    """Within it, a signal that asks the process to end is obeyed in about a second.

    Not for writing: a process that is ended like this tidies nothing up.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard, told = socket.socketpair()
    told.setblocking(False)
    left = threading.Event()
    watcher = threading.Thread(target=_watch, args=(heard, left), daemon=True)
    before, hook = (
        signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False),
        sys.unraisablehook,
    )
    sys.unraisablehook = _without_interrupts
    watcher.start()
    try:
        yield
    finally:
        left.set()
        signal.set_wakeup_fd(before)
        sys.unraisablehook = hook
        told.close()  # which ends the watcher
        watcher.join()
        heard.close()


def _terminated(_number: int, _frame: FrameType | None) -> None:
    raise Terminated


def _watch(heard: socket.socket, left: threading.Event) -> None:
    while received := heard.recv(1):
        if received[0] in ENDING and not left.wait(GRACE_S):
            terminal.reset()
            terminal.error("interrupted.")
            os._exit(128 + received[0])


def _without_interrupts(unraisable: UnraisableHookArgs, /) -> None:
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)

"""The command line: arguments in, one call of the library, one report out. One file per command."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

__all__ = ["entry", "main"]

INTERRUPTED = 130


def entry() -> NoReturn:
    """The command `aobake`: runs main, and ends the process with its status."""
    # Modules and compilers make a million objects that stay: looking for garbage took 6 % of a first run.
    gc.set_threshold(100_000)
    status = main()
    if status >= 128:
        # LLVM that was interrupted halfway may crash while Python takes itself down.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; arguments are sys.argv[1:] unless given.

    Returns the exit status: 0 all done, 1 an asset could not be baked, 2 wrong usage or settings,
    130 interrupted, 143 terminated.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # file names are bytes: any of them must be printable
            stream.reconfigure(errors="backslashreplace")
    try:
        from aobake.cli.app import run

        return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:  # while the commands were still being imported
        return INTERRUPTED

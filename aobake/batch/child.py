"""A worker process as its parent sees it: started, given tasks, listened to, ended."""

from __future__ import annotations

import contextlib
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from aobake.batch.limits import bytes_held
from aobake.batch.scratch import make_scratch
from aobake.batch.tasks import Outcome, Task
from aobake.batch.worker import Ready
from aobake.errors import EngineError

__all__ = ["WORKER", "Child", "Heard"]

WORKER = (sys.executable, "-P", "-c", "from aobake.batch.worker import serve; serve()")
LAST_WORDS = 200  # lines of what a process printed that are kept
MOST_WORDS = 200  # bytes of a line
END_S = 5.0  # in which a process that is ended has to be gone

# Of libraries that write all numbers of threads alike: one thread each, since workers run side by side.
ONE_EACH = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

# Exit codes that Windows gives to processes that crash.
WINDOWS_CRASHES = {
    0xC0000005: "access violation",
    0xC000001D: "illegal instruction",
    0xC0000094: "division by zero",
    0xC00000FD: "stack overflow",
    0xC0000409: "stack buffer overrun",
}
OUT_OF_MEMORY = re.compile(
    r"bad_alloc|MemoryError|out of memory|cannot allocate memory", re.IGNORECASE
)


@dataclass(frozen=True, eq=False)
class Heard:
    """What a child said; None: it said its last, since its process ended."""

    child: Child
    answer: Ready | Outcome | None


class Child:
    """A process that does tasks.

    part : how the names of its unfinished files begin; '' until it has begun its first task
    """

    def __init__(self, command: Sequence[str], tell: Callable[[Heard], None]) -> None:
        """Start the process. Raises EngineError where the system refuses.

        tell : is called with all that it answers, in a thread of its own
        """
        self.part = ""
        self._scratch = make_scratch()
        try:
            self._process = _started(command, self._scratch.folder)
        except OSError as error:
            self._scratch.remove()
            raise EngineError(f"{command[0]}: no process can be started ({error}).") from error
        self._words: deque[str] = deque(maxlen=LAST_WORDS)
        self._threads = [
            threading.Thread(target=target, args=arguments, daemon=True)
            for target, arguments in ((self._listen, (tell,)), (self._keep_words, ()))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def bytes_held(self) -> int:
        """Bytes of memory that it has in use now."""
        return bytes_held(self._process.pid)

    @property
    def name(self) -> str:
        """For people."""
        return f"process {self._process.pid}"

    def give(self, task: Task) -> None:
        """Hand it a task. Where it has just died, the task is lost, and Heard tells of the death."""
        self._words.clear()  # of tasks before
        with contextlib.suppress(OSError):
            pickle.dump(task, _pipe(self._process.stdin), pickle.HIGHEST_PROTOCOL)
            _pipe(self._process.stdin).flush()

    def kill(self) -> None:
        """End it, whatever it does, and all that it started; returns at once."""
        if self._process.poll() is not None:
            return
        if sys.platform == "win32":
            self._process.kill()
        else:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def close(self) -> bool:
        """End it, wait for that, and remove what it leaves. Whether it is gone: a system may fail to do so."""
        self.kill()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            return False
        for thread in self._threads:
            thread.join(END_S)
        with contextlib.suppress(OSError):  # a task that it never took
            _pipe(self._process.stdin).close()
        self._scratch.remove()
        return True

    def died_of(self) -> str:
        """Why it ended, in a few words, after close."""
        code = self._process.returncode
        if code is None:
            return "it cannot be ended"
        if code < 0:
            what = (signal.strsignal(-code) or f"signal {-code}").lower()
        else:
            what = WINDOWS_CRASHES.get(code, f"exit status {code}")
        return ", ".join(filter(None, (what, self._where(), self._last_word())))

    def lacked_memory(self) -> bool:
        """Whether its last words say that it was refused memory."""
        return any(OUT_OF_MEMORY.search(line) for line in self._words)

    def _where(self) -> str:
        """The place in Python that it died in, by the words of faulthandler."""
        lines = iter(self._words)
        for line in lines:
            if line.startswith("Current thread"):
                place = re.search(r'([^/\\"]+)", line (\d+) in (\S+)', next(lines, ""))
                return f"in {place[3]} of {place[1]}, line {place[2]}" if place else ""
        return ""

    def _last_word(self) -> str:
        """The last line that it printed before faulthandler spoke, or was about to."""
        said = ""
        for line in self._words:
            if line.startswith("Fatal Python error"):
                break
            said = line or said
        return f'saying "{said}"' if said else ""

    def _listen(self, tell: Callable[[Heard], None]) -> None:
        # Exception: what a process sent that broke down in mid-word may be anything
        with _pipe(self._process.stdout) as stream, contextlib.suppress(Exception):
            while True:
                answer = pickle.load(stream)  # noqa: S301 - from our child
                if isinstance(answer, Ready):
                    self.part = answer.part  # at once: it may be ended before this is heard
                tell(Heard(self, answer))
        tell(Heard(self, None))

    def _keep_words(self) -> None:
        with _pipe(self._process.stderr) as stream:
            while line := stream.readline(MOST_WORDS):
                self._words.append(line.decode("utf-8", "replace").strip())


def _started(command: Sequence[str], folder: str) -> subprocess.Popen[bytes]:
    """A process that Ctrl-C in the terminal does not reach: what becomes of it then is for its parent to say.

    folder : for its temporary files
    """
    environment = {
        **ONE_EACH,
        **os.environ,
        "PYTHONPATH": _import_path(),
        "PYTHONFAULTHANDLER": "1",
        **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder),
    }
    flags = 0
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW
    return subprocess.Popen(  # noqa: S603 - the command is ours
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
        creationflags=flags,
    )


def _import_path() -> str:
    """What this process imports from: -P keeps the folder out that we are in, and these are named whole."""
    return os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    """One that is there, since it was asked for."""
    if pipe is None:
        raise ValueError("not a pipe")
    return pipe

"""A headless Chromium that a test looks at and presses keys in, over the pipe of its developer tools."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

__all__ = ["CHROMIUM", "Browser", "browsing"]

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = (
    *(
        "--headless",
        "--no-sandbox",
        "--no-first-run",
        "--disable-gpu",
        "--disable-3d-apis",
        "--remote-debugging-pipe",
    ),
    *("--disable-background-networking", "--proxy-server=127.0.0.1:9"),  # where nothing listens
)
# Chromium reads from 3 and writes to 4.
WIRED = "import os, sys; r, w, *c = sys.argv[1:]; os.dup2(int(r), 3); os.dup2(int(w), 4); os.execv(c[0], c)"
GIVEN_UP_S = 60.0
# name -> text that it types, and the code that browsers know it by
KEYS = {
    "Tab": ("", 9), "Enter": ("\r", 13), "End": ("", 35), "Home": ("", 36),
    "ArrowUp": ("", 38), "ArrowDown": ("", 40), "PageDown": ("", 34),
}  # fmt: skip


class Browser:
    """A page in a browser without a network."""

    def __init__(self, to: int, back: int) -> None:
        self._to, self._back, self._rest, self._calls = to, back, b"", 0
        self._target: str | None = None
        self._session: str | None = None
        self.trouble: list[str] = []

    def open(self, page: Path) -> None:
        """Show a file, and wait until its script has set data-state on the page."""
        self._target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=self._target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        self._call("Page.navigate", url=page.as_uri())
        # Until the file has arrived, the script may be asked in the empty page that was there before.
        self.run(
            "new Promise((done) => { const look = () => "
            "document.documentElement?.dataset.state ? done() : setTimeout(look, 10); look(); })"
        )

    def leave(self) -> None:
        """Close the page."""
        if self._target is not None:
            self._session = None
            self._call("Target.closeTarget", targetId=self._target)

    def run(self, script: str) -> Any:
        """What an expression gives, once it is settled."""
        asked = {"expression": script, "returnByValue": True, "awaitPromise": True}
        found = self._call("Runtime.evaluate", **asked)
        if "result" not in found:  # a page that is left takes its questions with it
            found = self._call("Runtime.evaluate", **asked)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def press(self, *keys: str) -> None:
        """Press keys one after the other: names in KEYS, or letters."""
        for key in keys:
            text, code = KEYS.get(key, (key, ord(key[0].upper())))
            common = {"key": key, "windowsVirtualKeyCode": code}
            self._call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
            self._call("Input.dispatchKeyEvent", type="keyUp", **common)

    def _call(self, method: str, **parameters: object) -> dict[str, Any]:
        self._calls += 1
        asked: dict[str, object] = {"id": self._calls, "method": method, "params": parameters}
        if self._session is not None:
            asked["sessionId"] = self._session
        os.write(self._to, json.dumps(asked).encode() + b"\0")
        while True:
            said = self._read()
            if said.get("id") == self._calls:
                return dict(said.get("result") or said.get("error", {}))
            if said.get("method") == "Runtime.exceptionThrown":
                self.trouble.append(json.dumps(said["params"])[:500])
            if said.get("method") == "Log.entryAdded":
                self.trouble.append(said["params"]["entry"]["text"])

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            more = os.read(self._back, 1 << 16)
            assert more, "the browser is gone"
            self._rest += more
        said, _, self._rest = self._rest.partition(b"\0")
        return dict(json.loads(said))


@contextlib.contextmanager
def browsing(profile: Path, width: int = 1200, height: int = 800) -> Iterator[Browser]:
    """A browser, ended in any case; one that says nothing for a minute is ended as well."""
    to_read, to_write = os.pipe()
    back_read, back_write = os.pipe()

    ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_read, back_write)]
    process = subprocess.Popen(
        [
            *(sys.executable, "-c", WIRED, *map(str, ends), str(CHROMIUM), *FLAGS),
            *(f"--user-data-dir={profile}", f"--window-size={width},{height}"),
        ],
        stderr=subprocess.DEVNULL,
        pass_fds=ends,
    )
    for end in (*ends, to_read, back_write):
        os.close(end)
    watchdog = threading.Timer(GIVEN_UP_S, process.kill)
    watchdog.start()
    try:
        yield Browser(to_write, back_read)
    finally:
        watchdog.cancel()
        process.kill()
        process.wait()
        os.close(to_write)
        os.close(back_read)

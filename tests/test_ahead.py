"""What the first bake compiles in processes beside it is what it needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from aobake import BakeSettings, Scene, ahead, bake_texture
from aobake.config import Command
from aobake.tracing.compiled import Kernel
from aobake.tracing.kept import Kept


def asked(function: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> set[tuple[str, str]]:
    """The kernels that a function calls, with the kinds of their arguments."""
    called: set[tuple[str, str]] = set()
    call = Kernel.__call__

    def noting(self: Kernel[..., object], *arguments: object) -> object:
        result = call(self, *arguments)
        called.update((self.py_func.__qualname__, kinds) for kinds in self.kinds[-1:])
        return result

    with monkeypatch.context() as patched:
        patched.setattr(Kernel, "__call__", noting)
        function()
    return called


def test_beside_a_texture_bake_nearly_all_that_it_needs_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    corners = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])
    scene = Scene.from_arrays(corners, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]))
    needed = asked(lambda: bake_texture(scene, BakeSettings(size=64, rays=4)), monkeypatch)
    beside = asked(ahead.compile_unwrapping, monkeypatch)
    beside |= asked(ahead.compile_for_texels, monkeypatch)
    assert {"flatten_pieces", "place_charts", "place_origins", "trace"} <= {n for n, _ in needed}
    assert len(needed - beside) <= 2


@pytest.mark.parametrize("command", ["vertex", "texture"])
def test_no_process_is_started_for_what_is_kept_or_on_a_single_processor(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Kept, "known", lambda _: True)
    assert ahead.compile_ahead(command) == 0
    monkeypatch.setattr(Kept, "known", lambda _: False)
    monkeypatch.setattr(ahead, "processors", lambda: 1)
    assert ahead.compile_ahead(command) == 0

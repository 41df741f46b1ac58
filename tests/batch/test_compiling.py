"""What a job needs is compiled before its time counts: every kernel, whatever the asset."""

from __future__ import annotations

from pathlib import Path

import pytest

from aobake import BakeSettings, EngineError
from aobake.batch import compiling
from aobake.batch.tasks import Task
from aobake.config import Command, Configured
from aobake.jobs import Job
from aobake.settings import ImageSettings, StoreSettings
from tests.support import ROOT, python

CHOSEN = Configured(bake=BakeSettings(ground="+y"), store=StoreSettings(), image=ImageSettings())
# The kernels that a process has are found in its modules; each knows the kinds of arguments that it has code for.
BAKE_AFTER = """
import sys
from pathlib import Path
from aobake import BakeSettings, bake_texture, bake_vertices
from aobake.batch.compiling import compile_for
from aobake.batch.pictures import thumbnails
from aobake.batch.tasks import Task
from aobake.config import Configured
from aobake.demo import hall
from aobake.jobs import Job
from aobake.settings import ImageSettings, StoreSettings
from aobake.tracing.compiled import Kernel

def compiled():
    modules = [module for name, module in sys.modules.items() if name.startswith("aobake.")]
    found = {item for module in modules for item in vars(module).values() if isinstance(item, Kernel)}
    return {(kernel.__name__, kinds) for kernel in found for kinds in kernel.kinds}

command, further = sys.argv[1], eval(sys.argv[2])
settings = BakeSettings(rays=32, max_rays=32, size=128, **further)
chosen = Configured(bake=settings, store=StoreSettings(), image=ImageSettings())
job = Job(command=command, input=Path("a.glb"), output=Path("b.glb"), chosen=chosen)
compile_for(Task(number=0, job=job, threads=1, pictures="thumbnails"))
before = compiled()
assert before
thumbnails((bake_vertices if command == "vertex" else bake_texture)(hall(), settings))
print(sorted(name for name, _ in compiled() - before))
"""


@pytest.mark.parametrize(
    ("command", "further"),
    [
        ("vertex", {"tolerance": 0.05, "falloff": "linear", "max_distance": "10%"}),
        ("texture", {"ground": "+y"}),
    ],
)
def test_a_bake_finds_every_kernel_compiled(command: str, further: dict[str, object]) -> None:
    done = python("-c", BAKE_AFTER, command, repr(further), folder=ROOT)
    assert done.stdout == "[]\n", done.stderr


def test_what_goes_wrong_is_left_for_the_job_to_say(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[BakeSettings] = []

    def broken(_: Command, settings: BakeSettings, *, shown: bool) -> None:
        assert not shown
        asked.append(settings)
        raise EngineError("no ray can be traced here.")

    monkeypatch.setattr(compiling, "_bake_little", broken)
    job = Job(command="vertex", input=Path("a.glb"), output=Path("b.glb"), chosen=CHOSEN)
    compiling.compile_for(Task(number=0, job=job, threads=1))
    assert [settings.ground for settings in asked] == ["+y"]

"""Machine code: made of LLVM's intermediate language, and loaded. The part that needs no numba.

numba takes 0.7 s to be imported and to know what kernels may ask of it; this takes 0.1 s.
"""

from __future__ import annotations

import functools
import itertools
import threading

import llvmlite
import llvmlite.binding as llvm

from aobake.errors import EngineError

__all__ = ["ENTRY", "emitted", "loaded", "processor"]

ENTRY = "entry"  # the function that object code is for

SPEED_LEVEL = 3  # of instructions; the intermediate language has been made fast already
_LOADED: list[object] = []  # code lives as long as the process
_LOADING = threading.Lock()
_NUMBERS = itertools.count()


@functools.cache
def processor() -> str:
    """What machine code is made by and for: LLVM, the platform and the processor with all that it can do."""
    features = llvm.get_host_cpu_features().flatten()
    told = (llvmlite.__version__, llvm.get_process_triple(), llvm.get_host_cpu_name(), features)
    return repr(told)


def emitted(module: llvm.ModuleRef) -> bytes:
    """Object code of a module, of which only the function ENTRY can be seen, and what that needs is left."""
    for held in itertools.chain(module.functions, module.global_variables):
        if not held.is_declaration and held.name != ENTRY:
            held.linkage = "internal"
    with _LOADING:
        machine = _machine()
        tuning = llvm.create_pipeline_tuning_options(speed_level=SPEED_LEVEL)
        tuning.loop_vectorization = True
        builder = llvm.create_pass_builder(machine, tuning)
        builder.getModulePassManager().run(module, builder)
        return bytes(machine.emit_object(module))


def loaded(code: bytes) -> int:
    """The address of ENTRY in object code, which stays in memory.

    Raises EngineError where it needs what this process has not.
    """
    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    with _LOADING:
        try:
            tracker = library.export_symbol(ENTRY).link(_linker(), f"kernel{next(_NUMBERS)}")
        except RuntimeError as error:
            raise EngineError(f"compiled code cannot be loaded: {error}.") from error
        _LOADED.append(tracker)
        return int(tracker[ENTRY])


@functools.cache
def _machine() -> llvm.TargetMachine:
    _ready()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=SPEED_LEVEL,
        reloc="static" if "86" in llvm.get_process_triple().split("-")[0] else "default",
        codemodel="jitdefault",
        jit=True,
    )


@functools.cache
def _linker() -> llvm.LLJIT:
    _ready()
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(jit=True)
    return llvm.create_lljit_compiler(machine, suppress_errors=True)


@functools.cache
def _ready() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()

"""Shorter ways through numba, for kernels: fewer passes, and modules that are linked once, at the end.

numba makes a function ready to be called: it links all that the function calls into its module, and theirs into
theirs, and makes machine code of each. Of a kernel only the whole is called, for which machine.py does so. And
every function goes through passes for closures, literals and array expressions, of which kernels have none.

Tried, as ratios of the processor seconds of compiling place_origins, 41 functions: modules linked once 0.72, fewer
passes 0.95 of that (0.82 of the calls of Python functions), with the same machine code.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core import cgutils, codegen, compiler
from numba.core.compiler_machinery import PassManager
from numba.core.registry import cpu_target

__all__ = ["KernelPasses", "gather", "module_of"]

# For closures, with statements, literal types, code of callees copied before it is typed, array expressions; for
# people: a list of types, and what was made parallel.
NOT_NEEDED = frozenset({
    "AnnotateTypes",
    "DumpParforDiagnostics",
    "FindLiterallyCalls",
    "InlineClosureLikes",
    "InlineInlinables",
    "InlineOverloads",
    "LiteralPropagationSubPipelinePass",
    "LiteralUnroll",
    "MakeFunctionToJitFunction",
    "NoPythonSupportedFeatureValidation",
    "NopythonRewrites",
    "RewriteDynamicRaises",
    "RewriteSemanticConstants",
    "WithLifting",
})  # fmt: skip


class KernelPasses(compiler.CompilerBase):
    """The passes that functions of kernels go through."""

    def define_pipelines(self) -> list[Any]:
        """numba's own, without those that find nothing to do."""
        usual = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state).passes
        passes = PassManager("kernel")
        passes.passes = [each for each in usual if each[0].__name__ not in NOT_NEEDED]
        passes.finalize()
        return [passes]


class _Gathered(codegen.JITCodeLibrary):
    """A function's module as text, and the libraries of what it calls. Nothing of it can be called."""

    def __init__(self, owner: Any, name: str) -> None:
        codegen.CodeLibrary.__init__(self, owner, name)
        self.texts: list[str] = []
        self.callees: list[Any] = []

    def add_ir_module(self, ir_module: Any) -> None:
        self.texts.append(cgutils.normalize_ir_text(str(ir_module)))

    def add_linking_library(self, library: Any) -> None:
        self.callees.append(library)

    def finalize(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0: kernels have no entry for Python. Raises RuntimeError where somebody else's function has one."""
        if not self.texts or any(name in text for text in self.texts):
            raise RuntimeError("numba serves kernels alone in this process, see compile_alone.")
        return 0


def gather() -> None:
    """From now on let numba gather modules, instead of making code that can be called."""
    owner = cpu_target.target_context.codegen()
    owner._library_class = _Gathered  # noqa: SLF001 - numba has no public way
    owner.set_env = _leave_unset


def _leave_unset(_name: str, _environment: object) -> None:
    """An environment is for functions that Python calls, and would be written where none has been loaded."""


def module_of(library: Any) -> llvm.ModuleRef:
    """The module of a compiled function, with those of all that it calls."""
    if not isinstance(library, _Gathered):
        return llvm.parse_assembly(library.get_llvm_str())
    whole, *others = map(llvm.parse_assembly, _texts(library))
    for other in others:
        whole.link_in(other)
    return whole


def _texts(library: Any) -> list[str]:
    """The modules of a library and of all that it calls, each once."""
    found: list[str] = []
    seen, waiting = set(), [library]
    while waiting:
        one = waiting.pop()
        if one not in seen:
            seen.add(one)
            if isinstance(one, _Gathered):
                found += one.texts
                waiting += one.callees
            else:
                found.append(one.get_llvm_str())
    return found

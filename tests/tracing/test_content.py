"""The digest of what a kernel is made from: what changes it, and what does not."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from types import FunctionType, ModuleType

import pytest

import aobake
from aobake.tracing.content import _names, _python, content

PLAIN = """
def kernel(x):
    return callee(x) + FACTOR

def callee(x):
    return OFFSETS[0] * x

FACTOR, OFFSETS = 2.0, np.array([1.0, 3.0])
"""


def digest(source: str) -> str:
    scope: dict[str, object] = {"__name__": "written"}
    exec(compile("import numpy as np\n" + source, "anywhere.py", "exec"), scope)
    return content(scope["kernel"])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("def callee", "\n# moved, and explained\ndef callee"),
        ("def callee(x):\n", "def callee(x):\n    'What it does.'\n"),
        ("FACTOR,", "UNUSED = 7\nFACTOR,"),
    ],
)
def test_where_it_stands_and_what_is_said_about_it_change_nothing(old: str, new: str) -> None:
    assert digest(PLAIN.replace(old, new)) == digest(PLAIN)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("+ FACTOR", "- FACTOR"),
        ("OFFSETS[0]", "OFFSETS[1]"),
        ("2.0,", "-2.0,"),
        ("[1.0, 3.0]", "[1.0, 3.5]"),
        ("[1.0, 3.0])", "[1.0, 3.0], np.float32)"),
        ("callee(x) +", "(lambda y: y)(x) +"),
    ],
)
def test_what_it_computes_changes_it_in_callees_and_constants_too(old: str, new: str) -> None:
    assert digest(PLAIN.replace(old, new)) != digest(PLAIN)


def test_functions_that_call_each_other_have_a_digest() -> None:
    mutual = "def kernel(x):\n    return other(x)\ndef other(x):\n    return kernel(x - 1)\n"
    assert digest(mutual) == digest(mutual)
    assert digest(mutual) != digest(mutual.replace("x - 1", "x - 2"))


def kernels() -> list[FunctionType]:
    """All of aobake's, with everything of aobake's that they call."""
    names = [module.name for module in pkgutil.walk_packages(aobake.__path__, "aobake.")]
    modules = [import_module(name) for name in names if "__main__" not in name]
    held = [value for module in modules for value in vars(module).values()]
    found: dict[FunctionType, None] = {}
    waiting = [_python(value) for value in held if hasattr(value, "py_func")]
    while waiting:
        function = waiting.pop()
        if isinstance(function, FunctionType) and function not in found:
            found[function] = None
            reached = [function.__globals__.get(name) for name in _names(function.__code__)]
            waiting += [_python(value) for value in reached]
    return [function for function in found if function.__module__.startswith("aobake.")]


def test_kernels_name_functions_directly_since_those_behind_a_module_would_not_be_seen() -> None:
    found = kernels()
    assert len(found) > 100
    strays = [
        f"{function.__module__}.{function.__qualname__} names {value.__name__}"
        for function in found
        for name in _names(function.__code__)
        if isinstance(value := function.__globals__.get(name), ModuleType)
        and value.__name__.startswith("aobake")
    ]
    assert strays == []

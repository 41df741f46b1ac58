"""The rules of the house, read from the source: layers, import sites, silence, size."""

from __future__ import annotations

import ast
import functools
import importlib
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import aobake
from tests.support import ROOT, modules_after

PACKAGE = ROOT / "aobake"

# From the ground up: a module imports from its own layer and from those before it.
LAYERS = (
    (
        "errors", "checks", "findings", "overrides", "settings", "render_settings",
        "files", "images", "stages", "standalone",
    ),
    ("tracing",),
    ("meshes",),
    ("occluders", "prepare", "points", "sharing", "open_sky", "occlusion", "leastsquares"),
    ("atlas",),
    ("shading",),
    (
        "plan", "planning", "bake", "lightmaps",
        "previews", "results", "environment", "study", "report", "demo", "viewer", "__init__",
    ),
    ("ahead", "flags", "patterns", "config_file", "config", "jobs"),
    ("batch",),
    ("cli", "__main__"),
)  # fmt: skip
LAYER_OF = {name: number for number, names in enumerate(LAYERS) for name in names}

# What may be imported in several files; everything else from outside has one file of its own.
SEVERAL = {
    "numpy": "*.py",
    "numba": "tracing/*.py",
    "llvmlite": "tracing/*.py",
    "scipy": "tracing/*.py leastsquares/system.py",
}
STANDARD = sys.stdlib_module_names | {"aobake", "__future__"}


@dataclass(frozen=True)
class Import:
    """An import of `module` (full name); typing: only for annotations."""

    module: str
    typing: bool


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@functools.cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imports(tree: ast.AST, *, typing: bool = False) -> Iterator[Import]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, typing) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (Import(f"{node.module}.{alias.name}", typing) for alias in node.names)
        else:
            test = getattr(node, "test", None)
            guarded = isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"
            yield from imports(node, typing=typing or guarded)


def layer(module: str) -> int:
    """The layer of a module within aobake; the facade's names count as the facade's."""
    parts = module.split(".")[1:]
    if parts and (parts[0] in LAYER_OF):
        return LAYER_OF[parts[0]]
    if parts == ["__version__"]:
        return 0
    return LAYER_OF["__init__"]


def test_imports_run_one_way() -> None:
    upward = [
        f"{dotted(path)} imports {found.module}"
        for path in sources()
        for found in imports(parsed(path))
        if not found.typing
        and found.module.startswith("aobake.")
        and layer(found.module) > layer(dotted(path))
    ]
    assert upward == []


def test_every_module_has_a_layer() -> None:
    known = {path.stem if path.is_file() else path.name for path in PACKAGE.iterdir()}
    assert known - {"__pycache__", "py"} - LAYER_OF.keys() <= {"py.typed"}


def test_what_comes_from_outside_is_imported_in_one_place() -> None:
    sites: dict[str, set[Path]] = {}
    for path in sources():
        for found in imports(parsed(path)):
            name = found.module.split(".")[0]
            if name not in STANDARD and not found.typing:
                sites.setdefault(name, set()).add(path.relative_to(PACKAGE))
    assert "numpy" in sites
    for name, paths in sites.items():
        if name in SEVERAL:
            allowed = SEVERAL[name].split()
            strays = {p for p in paths if not any(p.match(pattern) for pattern in allowed)}
            assert not strays, f"{name} belongs into {allowed}"
        else:
            assert len(paths) == 1, f"{name} is imported in {sorted(map(str, paths))}"


def test_the_command_line_alone_draws_and_parses() -> None:
    for path in sources():
        names = {found.module.split(".")[0] for found in imports(parsed(path))}
        if names & {"cyclopts", "rich"}:
            assert path.parent.name == "cli", path


SPEAKS = {"print", "input", "breakpoint", "exit", "quit"}
LEAVES = {("sys", "exit"), ("os", "_exit"), ("sys", "stdout"), ("sys", "stderr"), ("sys", "argv")}


def said_in(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in SPEAKS:
                yield name
            case ast.Attribute(value=ast.Name(id=module), attr=name) if (module, name) in LEAVES:
                yield f"{module}.{name}"
            case ast.Name(id="SystemExit"):
                yield "SystemExit"


def test_the_library_never_prints_and_never_exits() -> None:
    library = [path for path in sources() if layer(dotted(path)) < LAYER_OF["cli"]]
    said = [f"{dotted(path)}: {what}" for path in library for what in said_in(parsed(path))]
    assert library
    assert said == []


def test_every_module_says_what_it_offers() -> None:
    strays = []
    for path in sources():
        name = dotted(path).removesuffix(".__init__")
        if name.endswith("__main__"):  # it is run, not imported
            continue
        module = importlib.import_module(name)
        offered = getattr(module, "__all__", [])
        sound = len(set(offered)) == len(offered) and all(hasattr(module, n) for n in offered)
        if not hasattr(module, "__all__") or not sound:
            strays.append(name)
    assert strays == []


def test_every_module_and_public_name_is_explained() -> None:
    strays = []
    for path in sources():
        tree = parsed(path)
        strays += [] if ast.get_docstring(tree) else [dotted(path)]
        strays += [
            f"{dotted(path)}.{node.name}"
            for node in tree.body
            if isinstance(node, ast.FunctionDef | ast.ClassDef)
            and not node.name.startswith("_")
            and not ast.get_docstring(node)
        ]
    assert strays == []


def test_the_public_names_are_sorted_and_all_there() -> None:
    assert sorted(aobake.__all__) == list(aobake.__all__)
    for name in aobake.__all__:
        assert getattr(aobake, name) is not None
    assert set(aobake.__all__) <= set(dir(aobake))
    with pytest.raises(AttributeError, match="no attribute 'bake_everything'"):
        _ = aobake.bake_everything


def test_importing_aobake_imports_nothing_heavy() -> None:
    heavy = {"numpy", "numba", "trimesh", "scipy", "DracoPy", "cyclopts", "rich"}
    assert not modules_after(["import aobake", "aobake.BakeSettings(rays=4)"]) & heavy


def test_a_file_is_one_idea() -> None:
    long = [p for p in sources() if len(p.read_text(encoding="utf-8").splitlines()) > 400]
    assert long == []


def texts() -> list[Path]:
    folders = [PACKAGE, ROOT / "tests", ROOT / "docs", ROOT / "benchmarks", ROOT / ".ci"]
    found = [p for folder in folders for p in folder.rglob("*") if p.is_file()]
    kinds = {".py", ".md", ".toml", ".typed", ""}
    found += [p for p in ROOT.iterdir() if p.is_file()]
    return [p for p in found if p.suffix in kinds and "__pycache__" not in p.parts]


def test_nothing_names_a_machine_or_is_left_open() -> None:
    folder = re.compile("|".join(f"/{name}/" + "[a-z]" for name in ("tmp", "work", "root", "home")))
    left_open = re.compile(r"\b(" + "|".join(("TO" + "DO", "FIX" + "ME", "X" * 3)) + r")\b")
    strays = []
    for path in texts():
        text = path.read_text(encoding="utf-8", errors="replace")
        if folder.search(text) or left_open.search(text):
            strays.append(str(path.relative_to(ROOT)))
    assert strays == []

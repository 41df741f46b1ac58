"""What the bytes of an output depend on besides the files that are read: the recipe of a job.

A job is up to date while three things are as they were: the version of aobake, its recipe, and the content of
every file that it read. The version is aobake's own, not that of the algorithm alone: a number that somebody
has to remember to raise would one day leave 10,000 outputs as they are, and nobody would know.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path

from aobake.jobs import Job
from aobake.settings import (
    AtlasSettings,
    BakeSettings,
    ImageSettings,
    StoreSettings,
    VertexSettings,
)

__all__ = ["difference", "fingerprint", "follows_content", "recipe"]

# threads: the result does not depend on them; quality: it is in the tolerance already
_IDLE = frozenset({"threads", "quality"})

# Asset -> outputs whose bytes are the same whatever the asset is called. All others tell its name: a mesh
# without a name is called after its file in OBJ and in GLB, and a .gltf names the files beside it.
_NAMELESS = {".glb": {".glb"}, ".gltf": {".glb"}, ".ply": {".ply"}}


def recipe(job: Job) -> str:
    """Everything but the version and the files that decides about the output of a job, as JSON on one line.

    Equal recipes are equal texts: keys are sorted, and 1.0 is written as 1.
    """
    chosen, folder = job.chosen, job.input.parent
    root = None if job.reading.root is None else _from(folder, job.reading.root)
    reading = (job.reading.scene, job.reading.pose, root)
    kept = chosen.store if job.command == "vertex" else chosen.image
    return _recipe(job.command, job.output.suffix.lower(), chosen.bake, kept, reading)


def _from(folder: Path, root: Path) -> str:
    """The root seen from the folder of the asset: it stays the same where a whole tree is moved."""
    try:
        return Path(os.path.relpath(root, folder)).as_posix()
    except ValueError:  # another drive
        return root.as_posix()


# The assets of a folder mostly share their settings: a look-up takes a tenth of writing them down.
@functools.lru_cache(maxsize=1024)
def _recipe(
    command: str,
    ending: str,
    bake: BakeSettings,
    kept: StoreSettings | ImageSettings,
    reading: tuple[str | None, ...],
) -> str:
    others = AtlasSettings if command == "vertex" else VertexSettings
    left_out = _IDLE | {field.name for field in dataclasses.fields(others)}
    settings = dataclasses.asdict(bake) | dataclasses.asdict(kept)
    parts = {
        "command": command,
        "ending": ending,
        "settings": {name: _plain(v) for name, v in settings.items() if name not in left_out},
        "reading": dict(zip(("scene", "pose", "root"), reading, strict=True)),
    }
    return json.dumps(parts, sort_keys=True, separators=(",", ":"))


def _plain(value: object) -> object:
    """The same number as the same text, whether it was given as 1 or as 1.0."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


@functools.lru_cache(maxsize=1024)
def fingerprint(recipe: str) -> str:
    """Hexadecimal SHA-256 of a recipe."""
    return hashlib.sha256(recipe.encode()).hexdigest()


def difference(before: str, now: str) -> str:
    """What differs between two recipes, for people: 'rays 64 -> 256, seed 0 -> 1'; '' where nothing does."""
    old, new = _flat(json.loads(before)), _flat(json.loads(now))
    names = [name for name in new | old if old.get(name) != new.get(name)]
    return ", ".join(
        f"{name} {json.dumps(old.get(name))} -> {json.dumps(new.get(name))}" for name in names
    )


def _flat(parts: Mapping[str, object]) -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in parts.items():
        flat |= value if isinstance(value, dict) else {name: value}
    return flat


def follows_content(job: Job) -> bool:
    """Whether the output is the same for an asset of another name with the same content."""
    bake = job.chosen.bake
    by_name = bake.occluders not in {("all",), ("own",)} or bool(bake.exclude)
    ending = job.input.suffix.lower()
    if job.output.suffix.lower() not in _NAMELESS.get(ending, ()):
        return False
    return not (by_name and ending == ".ply")  # whose one mesh is called after its file

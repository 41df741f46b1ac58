"""Whatever is done to a file, reading it gives a scene or one line that says what is wrong."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import InputError, OutputError
from aobake.meshes.formats import gltf
from aobake.meshes.scene import Scene
from aobake.settings import Store, StoreSettings
from tests.meshes.formats.gltf.build import Builder, Json, load, pack_glb, unpack_glb
from tests.meshes.formats.gltf.test_gltf_draco import packed, stream
from tests.meshes.formats.gltf.test_gltf_nodes import skinned_square

ROUNDS = 24  # for each way to damage a file; `make fuzz` goes on for as long as it is asked
STORES: tuple[Store, ...] = ("color", "occlusion", "attribute")
STRANGE: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**31, 2**53, 2**70, 1.5, -0.0, 1e300, "x", "", [], {}, [[]], [0], {"a": 1},
    "data:,", "http://host/b", "../x", "a\0b", "\ud800", [0, 1, 2], "\\\\",
)  # fmt: skip


def rich() -> Builder:
    """A little of everything that a reader branches on."""
    builder = Builder()
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(bytes([1])), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(12))},
    }
    attributes = {
        "NORMAL": builder.accessor([[0, 0, 1]] * 4, sparse=sparse),
        "COLOR_0": builder.accessor([[1, 2, 3, 4]] * 4, "u1", normalized=True),
        "TEXCOORD_0": builder.accessor([[0, 0]] * 4),
    }
    targets = [{"POSITION": builder.accessor([[0, 0, 1]] * 4)}]
    variants = {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}}
    look = {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0}
    builder.put("materials", {"name": "a", "pbrMetallicRoughness": look, "alphaMode": "MASK"})
    builder.put("materials", {"occlusionTexture": {"index": 0}})
    builder.put("textures", {"source": 0})
    builder.put("images", {"uri": "missing.png"})
    mesh = builder.mesh(
        builder.primitive(attributes=attributes, material=0, targets=targets, extensions=variants),
        builder.primitive(mode=5, material=1),
        weights=[0.5],
    )
    gpu = {
        "EXT_mesh_gpu_instancing": {
            "attributes": {"TRANSLATION": builder.accessor([[1, 2, 3]] * 2)}
        }
    }
    child = builder.node(mesh=mesh, extensions=gpu, rotation=[0, 0, 0, 1])
    return builder.show(builder.node(mesh=mesh, children=[child], scale=[1, 2, 3], name="top"))


SEEDS: dict[str, Callable[[], Builder]] = {
    "rich": rich,
    "skin": lambda: skinned_square([[1, 0, 0, 0]] * 4, [1, 1, 1], [1, 0]),
    "draco": lambda: packed(stream()),
}


def places(value: object, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values within a JSON value."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    found = [path] if path else []
    for key, item in inner:
        found += places(item, (*path, key))
    return found


def damaged_json(document: Json, rng: random.Random) -> Json:
    """A copy with a few values replaced, removed or shifted."""
    found = json.loads(json.dumps(document))
    paths = places(found)
    for _ in range(rng.choice([1, 1, 2, 4])):
        *path, last = rng.choice(paths)
        holder = found
        try:
            for key in path:
                holder = holder[key]
            way = rng.random()
            if way < 0.2:
                del holder[last]
            elif way < 0.4 and isinstance(holder[last], int):
                holder[last] += rng.choice([-1, 1, 2, 100])
            else:
                holder[last] = rng.choice(STRANGE)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change took this place away
    return dict(found)


def damaged_bytes(data: bytes, rng: random.Random) -> bytes:
    """A copy with a few bytes changed, sometimes cut."""
    found = bytearray(data)
    for _ in range(rng.choice([1, 3, 20])):
        found[rng.randrange(len(found))] = rng.randrange(256)
    return bytes(found[: rng.randrange(len(found))] if rng.random() < 0.3 else found)


def refused(action: Callable[[], object]) -> str:
    """The one line with which an action is refused, '' where it is not; anything else goes through."""
    try:
        action()
    except (InputError, OutputError) as error:
        return str(error)
    return ""


def read_and_write(path: Path, out: Path) -> None:
    """Both may refuse, in one line; nothing else may happen."""
    scenes: list[Scene] = []
    line = refused(lambda: scenes.append(load(path)))
    assert "\n" not in line
    assert path.name in line or scenes
    for scene in scenes:
        assert scene.source is not None
        assert "\n" not in refused(scene.source.facts)
        ao = [np.full(len(mesh.vertices), 0.5, np.float32) for _, mesh in scene.placed()]
        for store in STORES:
            settings = StoreSettings(store=store)
            line = refused(partial(gltf.write, scene, ao, out, settings))
            assert "\n" not in line


@pytest.mark.parametrize("what", ["json", "buffer", "file"])
@pytest.mark.parametrize("name", list(SEEDS))
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, name: str, what: str) -> None:
    builder = SEEDS[name]()
    path = builder.glb(tmp_path / "a.glb")
    whole = path.read_bytes()
    document, binary, _ = unpack_glb(path)
    rng = random.Random(f"{name} {what} 1")
    for _ in range(ROUNDS):
        if what == "json":
            path.write_bytes(pack_glb(damaged_json(document, rng), binary))
        elif what == "buffer":
            path.write_bytes(pack_glb(document, damaged_bytes(binary, rng)))
        else:
            path.write_bytes(damaged_bytes(whole, rng))
        read_and_write(path, tmp_path / "b.glb")

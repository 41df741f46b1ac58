"""Where the outputs of a batch go: names in the target, and who may not share them."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import PurePosixPath

from aobake.batch.tasks import Planned
from aobake.config import Command
from aobake.errors import SettingsError, nearest
from aobake.meshes.formats import IMAGES, TEXTURE_WRITABLE, WRITABLE

__all__ = ["check_format", "output_name", "without_clashes"]

KEPT: Mapping[Command, tuple[str, ...]] = {"vertex": WRITABLE, "texture": TEXTURE_WRITABLE}
HELD: Mapping[Command, tuple[str, ...]] = {"vertex": WRITABLE, "texture": TEXTURE_WRITABLE + IMAGES}
WHAT: Mapping[Command, str] = {"vertex": "values at vertices", "texture": "a lightmap texture"}
ELSE = ".glb"  # for what cannot be kept in the asset's own format
MOST_BYTES = 255  # of a name, in nearly every file system
WITH_IMAGES = (".gltf", ".obj")  # whose lightmaps are files of their own, both named NAME_ao.png


def check_format(command: Command, ending: str) -> None:
    """Raise SettingsError, in words of the field `format`, where it cannot hold what is baked. ending : glb"""
    if f".{ending}" not in HELD[command]:
        known = [suffix[1:] for suffix in HELD[command]]
        raise SettingsError(
            f"format is {ending!r}, which cannot hold {WHAT[command]}.{nearest(ending, known)}"
        )


def output_name(asset: str, command: Command, ending: str | None, *, alone: bool) -> str:
    """The name of an output: that of the asset, with an ending that can hold the result.

    ending : the one that is asked for, such as glb; None: that of the asset where it can hold it, else glb
    alone : whether it is the only output of the asset; else the name tells what was baked
    Raises SettingsError where the name cannot be, or the ending cannot hold it.
    """
    own = PurePosixPath(asset).suffix
    stem = asset.removesuffix(own)
    if ending is not None:
        check_format(command, ending)
        suffix = own if own.lower() == f".{ending}" else f".{ending}"
    else:
        suffix = own if own.lower() in KEPT[command] else ELSE
    name = f"{stem}{suffix}" if alone else f"{stem}_{command}{suffix}"
    if len(os.fsencode(name.rpartition("/")[2])) > MOST_BYTES:
        raise SettingsError(f"its output would have a name of more than {MOST_BYTES} bytes.")
    return name


def without_clashes(planned: Iterable[Planned]) -> Iterator[Planned]:
    """The same jobs, with those refused that would write one file, each naming another of them.

    All of them are, and not all but the first, so that what is baked does not hang on an order.
    """
    jobs = list(planned)
    users: dict[tuple[str, str], list[Planned]] = defaultdict(list)
    for one in jobs:
        for claim in _claims(one):
            users[claim].append(one)
    for one in jobs:
        rival = next((other for c in _claims(one) for other in users[c] if other is not one), None)
        yield one if rival is None else replace(one, target="", refused=_clash(one, rival))


def _claims(planned: Planned) -> list[tuple[str, str]]:
    """What no other job may write as well."""
    if planned.refused:
        return []
    suffix = PurePosixPath(planned.target).suffix
    images = planned.job.command == "texture" and suffix.lower() in WITH_IMAGES
    return [
        ("file", planned.target),
        *([("images", planned.target.removesuffix(suffix))] if images else []),
    ]


def _clash(one: Planned, rival: Planned) -> str:
    what = one.target if one.target == rival.target else f"images beside {one.target}"
    return (
        f"{one.job.input}: {what} would also be written for {rival.source}. "
        "Leave one of them out (--skip), or give one another format in aobake.toml."
    )

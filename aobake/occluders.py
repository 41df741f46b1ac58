"""Which instances occlude: all, each itself alone, or those that go by a name or have an extra."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import SettingsError, nearest
from aobake.meshes.scene import Instance, Scene
from aobake.settings import TraceSettings

__all__ = ["alone", "occluding"]

EXTRAS = "extras:"


@dataclass(frozen=True)
class _Marks:
    """What an instance, its mesh and its material go by.

    names : theirs; extras : the keys of what is noted there, and KEY=VALUE for each value
    """

    names: Collection[str]
    extras: Collection[str]


def alone(settings: TraceSettings) -> bool:
    """Whether each instance is occluded by itself alone."""
    return settings.occluders == ("own",)


def occluding(scene: Scene, settings: TraceSettings) -> NDArray[np.bool_]:
    """(I,) which instances occlude anything at all.

    Raises SettingsError for names and extras that nothing in the scene has, and for a word between names.
    """
    words = settings.occluders
    chosen = np.ones(len(scene.instances), bool)
    everything = words in {("all",), ("own",)}
    if everything and not settings.exclude:
        return chosen
    marks = [_marks(scene, instance) for instance in scene.instances]
    if not everything:
        chosen = _marked("occluders", words, marks)
    return chosen & ~_marked("exclude", settings.exclude, marks)


def _marks(scene: Scene, instance: Instance) -> _Marks:
    mesh = scene.meshes[instance.mesh]
    material = None if mesh.material is None else scene.materials[mesh.material]
    things = (instance, mesh) if material is None else (instance, mesh, material)
    noted = [(key, value) for thing in things for key, value in thing.extras.items()]
    return _Marks(
        names={thing.name for thing in things} - {""},
        extras={mark for key, value in noted for mark in _extras(key, value)},
    )


def _extras(key: str, value: object) -> Iterator[str]:
    """KEY, unless it is switched off, and KEY=VALUE; of a list for each value in it."""
    if value is not None and value is not False:
        yield key
    for one in value if isinstance(value, list) else [value]:
        if isinstance(one, bool):
            yield f"{key}={str(one).lower()}"
        elif isinstance(one, float) and one.is_integer():
            yield f"{key}={one:.0f}"
        elif isinstance(one, str | int | float):
            yield f"{key}={one}"


def _marked(field: str, words: Sequence[str], marks: Sequence[_Marks]) -> NDArray[np.bool_]:
    """(I,) which instances go by any of the words, in which * and ? stand for letters."""
    chosen = np.zeros(len(marks), bool)
    for word in words:
        found = _named(word, [own.names for own in marks])
        if word.startswith(EXTRAS) and not found.any():
            found = _named(word.removeprefix(EXTRAS), [own.extras for own in marks])
        if not found.any():
            raise SettingsError(f"{field} is {word!r}; {_unknown(word, marks)}")
        chosen |= found
    return chosen


def _named(word: str, several: Sequence[Collection[str]]) -> NDArray[np.bool_]:
    return np.array([word in own or _matches(word, own) for own in several], bool)


def _matches(pattern: str, names: Collection[str]) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for name in names)


def _unknown(word: str, marks: Sequence[_Marks]) -> str:
    """What is wrong with a word that nothing goes by, and what comes near it."""
    if not word.startswith(EXTRAS):
        known = {name for own in marks for name in own.names}
        return (
            f"nothing in the scene goes by this name.{nearest(word, known)}"
            if known
            else "nothing in the scene has a name."
        )
    extras = {extra for own in marks for extra in own.extras}
    with_value = "=" in word
    known = {EXTRAS + extra for extra in extras if with_value or "=" not in extra}
    return (
        f"no node, mesh or material has this extra.{nearest(word, known)}"
        if known
        else "no node, mesh or material has extras."
    )

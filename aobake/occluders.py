"""Which instances occlude: all, each itself alone, or those that are named."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.errors import SettingsError, nearest
from aobake.meshes.scene import Instance, Scene
from aobake.settings import TraceSettings

__all__ = ["alone", "occluding"]


def alone(settings: TraceSettings) -> bool:
    """Whether each instance is occluded by itself alone."""
    return settings.occluders == ("own",)


def occluding(scene: Scene, settings: TraceSettings) -> NDArray[np.bool_]:
    """(I,) which instances occlude anything at all.

    Raises SettingsError for names that nothing in the scene has, and for a word between names.
    """
    names = [_names(scene, instance) for instance in scene.instances]
    words = settings.occluders
    chosen = np.ones(len(names), bool)
    if words not in {("all",), ("own",)}:
        chosen = _named("occluders", words, names)
    return chosen & ~_named("exclude", settings.exclude, names)


def _names(scene: Scene, instance: Instance) -> set[str]:
    """What an instance goes by: its own name, its mesh's, and its material's."""
    mesh = scene.meshes[instance.mesh]
    material = "" if mesh.material is None else scene.materials[mesh.material].name
    return {instance.name, mesh.name, material} - {""}


def _named(field: str, words: Sequence[str], names: Sequence[set[str]]) -> NDArray[np.bool_]:
    """(I,) which instances go by any of the words, in which * and ? stand for letters."""
    chosen = np.zeros(len(names), bool)
    for word in words:
        found = np.array([word in own or _matches(word, own) for own in names], bool)
        if not found.any():
            known = set().union(*names)
            raise SettingsError(
                f"{field} is {word!r}; nothing in the scene goes by this name.{nearest(word, known)}"
                if known
                else f"{field} is {word!r}; nothing in the scene has a name."
            )
        chosen |= found
    return chosen


def _matches(pattern: str, names: set[str]) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for name in names)

"""Animations: where a clip puts the nodes at one moment.

Source: glTF 2.0, section 3.11.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, SettingsError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.keyframes import Interpolation, Keyframes, lerp, slerp, value_at

__all__ = ["Pose", "Posed", "pose_of", "posed_nodes"]

FloatArray = NDArray[np.float64]
PATHS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3", "weights": "SCALAR"}
POINTER = {"pointer": "KHR_animation_pointer"}  # its path, as people know it


@dataclass(frozen=True)
class Pose:
    """A moment of a clip.

    clip : its name or number
    """

    clip: str
    seconds: float


@dataclass(frozen=True)
class Posed:
    """What a pose makes of a document.

    label : the clip and the moment, as messages name them
    nodes : number -> node as it stands then; those that the clip does not move are left out
    warnings : what of the clip is passed over, one line each
    """

    label: str
    nodes: Mapping[int, Element]
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Channel:
    """Which property of which node a sampler moves; node None: a property of something else."""

    node: int | None
    path: str
    sampler: Element
    times: FloatArray


def pose_of(text: str) -> Pose:
    """The pose written as CLIP@SECONDS. Raises SettingsError for anything else."""
    clip, _, time = text.rpartition("@")
    try:
        seconds = float(time)
    except ValueError:
        seconds = math.nan
    if not clip or not math.isfinite(seconds):
        raise SettingsError(f"a pose is CLIP@SECONDS, such as Walk@0.5 or 0@0.5, not {text!r}.")
    return Pose(clip, seconds)


def posed_nodes(reader: AccessorReader, pose: Pose) -> Posed:
    """The nodes that a clip moves, with what it makes of them at a moment.

    Properties within the clip that begin later or end earlier keep their first or last value. What
    moves something else than nodes is passed over, with a warning.
    Raises InputError for an unknown clip, a time outside of it, and a clip that cannot be read.
    """
    document = reader.document
    number = document.find("animations", pose.clip)
    clip = document.entry("animations", number)
    channels = list(_channels(reader, clip))
    seconds = _time_within(channels, pose, clip)
    moves: dict[int, dict[str, list[float]]] = {}
    for channel in channels:
        if channel.node is not None and channel.path in PATHS:
            value = value_at(
                _keyframes(reader, channel),
                seconds,
                slerp if channel.path == "rotation" else lerp,
            )
            moves.setdefault(channel.node, {})[channel.path] = value.tolist()
    return Posed(
        label=f"{document.label('animations', number)} at {pose.seconds:g} s",
        nodes={node: _moved(document.entry("nodes", node), to) for node, to in moves.items()},
        warnings=_passed_over(channels, clip),
    )


def _channels(reader: AccessorReader, clip: Element) -> Iterator[_Channel]:
    document = reader.document
    samplers = clip.children("samplers", "sampler")
    times: dict[int, FloatArray] = {}
    for channel in clip.children("channels", "channel"):
        target = channel.needed("target")
        number = channel.index("sampler", len(samplers), "samplers in this clip")
        if number not in times:
            times[number] = _times(reader, samplers[number])
        node = target.maybe_index("node", document.size("nodes"), "nodes")
        yield _Channel(node, target.text("path"), samplers[number], times[number])


def _times(reader: AccessorReader, sampler: Element) -> FloatArray:
    number = sampler.index("input", reader.document.size("accessors"), "accessors")
    times: FloatArray = reader.floats(number, ("SCALAR",))[:, 0]
    if not len(times):
        raise InputError(f"{sampler.where} has no keys; one at least is needed. Export it again.")
    if not np.isfinite(times).all() or np.any(np.diff(times) < 0.0):
        raise InputError(
            f"{sampler.where}: its times are not finite, or run backwards. Export it again."
        )
    return times


def _time_within(channels: list[_Channel], pose: Pose, clip: Element) -> float:
    """The time that was asked for, rounded as those of the file are. Raises InputError outside of the clip."""
    if not channels:
        raise InputError(f"{clip.where} has no channels, so it has no pose. Take another clip.")
    with np.errstate(over="ignore"):
        seconds = np.float32(pose.seconds)
    first = np.float32(min(0.0, *(channel.times[0] for channel in channels)))
    last = np.float32(max(channel.times[-1] for channel in channels))
    if not first <= seconds <= last:
        raise InputError(
            f"{clip.where} lasts from {first!s} to {last!s} s, and {pose.seconds:g} s was asked for."
        )
    return float(seconds)


def _keyframes(reader: AccessorReader, channel: _Channel) -> Keyframes:
    sampler, count = channel.sampler, len(channel.times)
    way = sampler.text("interpolation", "LINEAR")
    if way not in get_args(Interpolation):
        raise InputError(
            f"{sampler.where}: interpolation is {way[:20]!r}; "
            f"{', '.join(get_args(Interpolation))} exist."
        )
    number = sampler.index("output", reader.document.size("accessors"), "accessors")
    values = reader.floats(number, (PATHS[channel.path],))
    rows = 3 * count if way == "CUBICSPLINE" else count
    # Morph targets have a weight each at every key; all else has one row.
    sound = len(values) % rows == 0 if channel.path == "weights" else len(values) == rows
    if not sound:
        raise InputError(
            f"{sampler.where}: {len(values)} values for {count} keys do not go with {channel.path} and {way}. "
            "Export it again."
        )
    if not np.isfinite(values).all():
        raise InputError(f"{sampler.where}: a {channel.path} is not finite. Export it again.")
    per_key = (count, 3) if way == "CUBICSPLINE" else (count,)
    shaped = values.reshape(*per_key, values.size // rows)
    return Keyframes(channel.times, shaped, cast(Interpolation, way))


def _moved(node: Element, to: Mapping[str, list[float]]) -> Element:
    """A node with other properties. Raises InputError where a matrix stands in their way."""
    if "matrix" in node and not to.keys() <= {"weights"}:
        raise InputError(
            f"{node.where} has a matrix, and the clip moves its {min(to)}; an animated node has translation, "
            "rotation and scale. Export it again."
        )
    return Element({**node.value, **to}, node.where)


def _passed_over(channels: list[_Channel], clip: Element) -> tuple[str, ...]:
    strange = [channel.path for channel in channels if channel.path not in PATHS]
    if not strange:
        return ()
    names = ", ".join(sorted({POINTER.get(path, repr(path[:20])) for path in strange}))
    return (
        f"{clip.where}: {len(strange)} of its {len(channels)} channels move what is no place, size or "
        f"weight of a node ({names}); they are passed over.",
    )

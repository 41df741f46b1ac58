"""Where a scene's surfaces lie on images: texture coordinates that are there and good, or new ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.charts import counted
from aobake.atlas.existing import Unfolded, Verdict, chart_numbers, face_areas, judge
from aobake.atlas.packing import pack
from aobake.atlas.unwrap import Charts, unwrap
from aobake.errors import InputError
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.lightmap import Kept, Placing, Unwrapped
from aobake.meshes.scene import FloatArray, Scene
from aobake.prepare import Prepared, name_of
from aobake.settings import AtlasSettings

__all__ = ["Intended", "Layout", "Page", "intended", "lay_out"]

Progress = Callable[[int, int], None]
SETS = 8  # TEXCOORD_n that are looked at


@dataclass(frozen=True, eq=False, kw_only=True)
class Page:
    """One image.

    instances : the instances on it; of those that are stored together, the first alone
    corners : (F, 3, 2) float64 of each, u and v in [0, 1] of its mesh's faces
    charts : (F,) int32 of each, numbers that are unique on the page; -1 for a face that has no place
    origin : one sentence on where the texture coordinates come from
    """

    instances: tuple[int, ...]
    corners: tuple[FloatArray, ...]
    charts: tuple[NDArray[np.int32], ...]
    origin: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Layout:
    """pages, and where each instance of the scene is on them; None for one without a usable triangle."""

    pages: tuple[Page, ...]
    placings: tuple[Placing | None, ...]


@dataclass(frozen=True, kw_only=True)
class Intended:
    """pages : how many there will be; unwrapped : the meshes that get new texture coordinates"""

    pages: int
    unwrapped: tuple[int, ...]


def intended(scene: Scene, prepared: Prepared, settings: AtlasSettings) -> Intended:
    """What lay_out will do, without doing it. Raises InputError where texture coordinates are missing or overlap."""
    groups = _groups(scene, prepared, settings)
    choices = [_choice(scene, group, settings) for group in groups]
    return Intended(pages=len(groups), unwrapped=tuple(_loose(scene, groups, choices)))


def _loose(scene: Scene, groups: Sequence[Sequence[int]], choices: Sequence[_Choice]) -> list[int]:
    """The meshes of groups that keep no texture coordinates, each once."""
    several = [
        scene.instances[number].mesh
        for group, choice in zip(groups, choices, strict=True)
        if choice.uv_set is None
        for number in group
    ]
    return list(dict.fromkeys(several))


def lay_out(
    scene: Scene,
    prepared: Prepared,
    settings: AtlasSettings,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Layout:
    """Give every instance that has an area its place on an image.

    progress : called with faces unwrapped, and all there are
    Raises InputError where texture coordinates were asked for that are missing or overlap, and where an
    image is too small for what has to go on it.
    """
    groups = _groups(scene, prepared, settings)
    choices = [_choice(scene, group, settings) for group in groups]
    charts = _charts(scene, _loose(scene, groups, choices), settings, threads, progress)
    pages: list[Page] = []
    placings: dict[int, Placing] = {}
    for number, (group, choice) in enumerate(zip(groups, choices, strict=True)):
        if choice.uv_set is not None:
            page, layouts = _kept_page(scene, group, choice.uv_set, choice.reason)
        else:
            page, layouts = _new_page(scene, group, charts, choice.reason, settings)
        pages.append(page)
        placings |= {
            instance: Placing(page=number, layout=layout)
            for instance, layout in zip(group, layouts, strict=True)
        }
    together = [_stored_with(scene, number) for number in range(len(scene.instances))]
    return Layout(pages=tuple(pages), placings=tuple(placings.get(number) for number in together))


def _stored_with(scene: Scene, number: int) -> int:
    """The instance whose place in the file an instance shares: itself where it has its own."""
    first = scene.instances[number].stored_with
    return number if first is None else first


def _groups(scene: Scene, prepared: Prepared, settings: AtlasSettings) -> list[tuple[int, ...]]:
    """Instances that share an image, those with a usable triangle, each place in the file once."""
    shown = [
        number
        for number, stands in enumerate(prepared.placed)
        if stands is not None and len(stands[1].faces) and _stored_with(scene, number) == number
    ]
    keys: Mapping[str, Callable[[int], object]] = {
        "scene": lambda _: None,
        "material": lambda number: scene.meshes[scene.instances[number].mesh].material,
        "mesh": lambda number: number,
    }
    groups: dict[object, list[int]] = {}
    for number in shown:
        groups.setdefault(keys[settings.atlas](number), []).append(number)
    return [tuple(group) for group in groups.values()]


@dataclass(frozen=True)
class _Choice:
    """The set of texture coordinates that a group keeps, or None; and why."""

    uv_set: int | None
    reason: str


def _choice(scene: Scene, group: Sequence[int], settings: AtlasSettings) -> _Choice:
    """Whether a group keeps a set that it has. Raises InputError where it was told to and cannot."""
    if settings.uv == "unwrap":
        return _Choice(None, "as asked for")
    asked = int(settings.uv) if settings.uv.isdigit() else None
    sets = _common_sets(scene, group) if asked is None else [asked]
    faults = []
    for uv_set in sets:
        try:
            verdict = _judged(scene, group, uv_set, settings.size)
        except InputError as error:  # missing, or broken
            faults.append(str(error).rstrip("."))
            continue
        if verdict.fault is None:
            return _Choice(uv_set, verdict.sentence)
        faults.append(verdict.sentence)
    reason = faults[0] if faults else _lacking(scene, group)
    if settings.uv != "auto":
        raise InputError(
            f"{_file(scene)}{reason}, and --uv {settings.uv} was given. Leave it out to unwrap the asset, "
            "or bake to vertex colours with `aobake vertex`."
        )
    return _Choice(None, reason)


def _common_sets(scene: Scene, group: Sequence[int]) -> list[int]:
    """The n of each TEXCOORD_n that all instances of a group have."""
    meshes = {scene.instances[number].mesh for number in group}
    return [
        n
        for n in range(SETS)
        if all(f"TEXCOORD_{n}" in scene.meshes[mesh].attributes for mesh in meshes)
    ]


def _lacking(scene: Scene, group: Sequence[int]) -> str:
    """Which instance of a group has no texture coordinates, or none that the others have."""
    for number in group:
        if not _common_sets(scene, [number]):
            return f"{name_of(scene, number)} has no TEXCOORD_0"
    return f"{name_of(scene, group[0])} has no set of texture coordinates that all others have"


def _corners(scene: Scene, number: int, uv_set: int) -> FloatArray:
    """(F, 3, 2) of an instance. Raises InputError where they are missing or broken."""
    found = scene.meshes[scene.instances[number].mesh].at_corners(f"TEXCOORD_{uv_set}")
    if found is None:
        raise InputError(f"{name_of(scene, number)} has no TEXCOORD_{uv_set}.")
    return found


def _judged(scene: Scene, group: Sequence[int], uv_set: int, size: int) -> Verdict:
    """Whether the group can be baked into a set. Raises InputError where one lacks it."""
    unfolded = []
    for number in group:
        instance = scene.instances[number]
        mesh = scene.meshes[instance.mesh]
        areas = face_areas(mesh.vertices @ instance.transform[:3, :3].T, mesh.faces)
        corners = _corners(scene, number, uv_set)
        unfolded.append(Unfolded(name=name_of(scene, number), corners=corners, areas=areas))
    return judge(unfolded, uv_set, size)


def _file(scene: Scene) -> str:
    return f"{scene.source.path}: " if scene.source else ""


def _kept_page(
    scene: Scene, group: tuple[int, ...], uv_set: int, reason: str
) -> tuple[Page, list[Kept | Unwrapped]]:
    """A page of texture coordinates that are there, and how each instance lies on it."""
    corners, charts, first = [], [], 0
    for number in group:
        mesh, uv = scene.meshes[scene.instances[number].mesh], _corners(scene, number, uv_set)
        usable = face_areas(mesh.vertices, mesh.faces) > 0.0
        found = chart_numbers(uv, first_equal_row(mesh.vertices)[mesh.faces], usable)
        corners.append(uv)
        charts.append(np.where(found >= 0, found + np.int32(first), np.int32(-1)))
        first += int(found.max(initial=-1)) + 1
    page = Page(
        instances=group,
        corners=tuple(corners),
        charts=tuple(charts),
        origin=f"{reason}, so it is kept: {counted(first)}.",
    )
    return page, [Kept(uv_set=uv_set) for _ in group]


def _charts(
    scene: Scene,
    meshes: Sequence[int],
    settings: AtlasSettings,
    threads: int | None,
    progress: Progress | None,
) -> dict[int, Charts]:
    """mesh -> its charts."""
    found = unwrap([scene.meshes[mesh] for mesh in meshes], settings, threads, progress)
    return dict(zip(meshes, found, strict=True))


def _new_page(
    scene: Scene,
    group: tuple[int, ...],
    charts: Mapping[int, Charts],
    reason: str,
    settings: AtlasSettings,
) -> tuple[Page, list[Kept | Unwrapped]]:
    """A page of new texture coordinates, and how each instance lies on it."""
    cut = [charts[scene.instances[number].mesh] for number in group]
    stretches = [_stretch(scene, number) for number in group]
    try:
        packed = pack(list(zip(cut, stretches, strict=True)), settings)
    except InputError as error:
        raise InputError(f"{_file(scene)}{error}") from error
    numbers, first = [], 0
    for one in cut:
        numbers.append(np.where(one.chart >= 0, one.chart + np.int32(first), np.int32(-1)))
        first += int(one.chart.max(initial=-1)) + 1
    hurry = (
        " The time was up: faces were seen along an axis." if any(c.hurried for c in cut) else ""
    )
    page = Page(
        instances=group,
        corners=tuple(uv[one.faces] for one, uv in zip(cut, packed.uv, strict=True)),
        charts=tuple(numbers),
        origin=(
            f"unwrapped ({reason}): {counted(first)}, padding {packed.padding}, fill "
            f"{100 * packed.filled:.0f} % at {packed.texels_per_unit:.4g} texels per unit.{hurry}"
        ),
    )
    return page, [
        Unwrapped(source=one.source, faces=one.faces, uv=uv)
        for one, uv in zip(cut, packed.uv, strict=True)
    ]


def _stretch(scene: Scene, number: int) -> float:
    """What the transform of an instance multiplies the lengths of its surface by, on the whole."""
    instance = scene.instances[number]
    mesh = scene.meshes[instance.mesh]
    linear = instance.transform[:3, :3]
    if np.array_equal(linear, np.eye(3)):
        return 1.0
    before = float(face_areas(mesh.vertices, mesh.faces).sum())
    after = float(face_areas(mesh.vertices @ linear.T, mesh.faces).sum())
    return math.sqrt(after / before) if before > 0.0 else 1.0

"""The hall: an arcade, a sphere in a niche, a well, steps and pots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aobake.demo.patches import Patch, joined, rounded_path
from aobake.demo.shapes import Flutes, apse, arched_wall, ball, frame, stone, surround, turned
from aobake.meshes.scene import FloatArray, Instance, Material, Mesh, Scene

__all__ = ["hall"]

MATERIALS = (
    Material(name="limestone", base_color=(0.50, 0.40, 0.29, 1.0), roughness=0.9),
    Material(name="pale stone", base_color=(0.56, 0.49, 0.40, 1.0), roughness=0.8),
    Material(name="terracotta", base_color=(0.36, 0.12, 0.06, 1.0), roughness=0.8),
    Material(name="glaze", base_color=(0.02, 0.20, 0.36, 1.0), roughness=0.25),
    Material(name="water", base_color=(0.03, 0.13, 0.13, 1.0), roughness=0.05),
    Material(name="cedar", base_color=(0.28, 0.13, 0.06, 1.0), roughness=0.7),
    Material(name="sand", base_color=(0.42, 0.33, 0.22, 1.0), roughness=1.0),
)
NUMBER_OF = {material.name: number for number, material in enumerate(MATERIALS)}

WALL_Z = -3.0
SIDE_X = 3.6  # of the colonnades
COLUMN_HEIGHT = 3.0
BAY = 1.9  # from one column to the next
FIRST_COLUMN_Z = -2.65
GROUND_Y = -0.66
MORTAR = 0.003  # stones that touched would hide each other's vertices


@dataclass(frozen=True)
class Place:
    """Where a part stands: turned about the vertical, scaled, then moved."""

    x: float
    y: float
    z: float
    turn_deg: float = 0.0
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh of one material, and every place where it stands."""

    name: str
    material: str
    shape: Patch
    places: tuple[Place, ...] = (Place(0.0, 0.0, 0.0),)


def hall() -> Scene:
    """A columned hall, open to the sky: 57,000 triangles in 22 meshes that stand 82 times, y up, in metres."""
    parts = [*_ground(), *_walls(), *_colonnades(), *_furniture()]
    meshes = [
        Mesh(
            name=part.name,
            vertices=part.shape.vertices,
            faces=part.shape.faces,
            normals=part.shape.normals,
            material=NUMBER_OF[part.material],
        )
        for part in parts
    ]
    instances = [
        Instance(mesh=number, name=f"{part.name} {count}", transform=_transform(place))
        for number, part in enumerate(parts)
        for count, place in enumerate(part.places, 1)
    ]
    return Scene(meshes=tuple(meshes), instances=tuple(instances), materials=MATERIALS)


def _ground() -> list[Part]:
    slab = stone((0.985, 0.16, 0.985), 0.02, 0.1, bedded=True)
    middles = [(x + 0.5, z + 0.5) for x in range(-4, 4) for z in range(-3, 3)]
    pale, red = (
        tuple(Place(x, -0.08, z) for x, z in middles if (x + z) % 2 == odd) for odd in (0, 1)
    )
    bed = stone((8.0, 0.48, 6.6), 0.02, 0.16, bedded=True)
    border = (4.0005, 3.9)
    ground = surround(border, 6.1, 0.25, 0.16)
    footing = frame(border, 0.4)  # or one would look through the joint and below the rounded stones
    steps = []
    for number, name in enumerate(("upper step", "middle step", "lower step")):
        height = 0.22 * (3 - number)
        shape = stone((8.0, height, 0.398), 0.03, 0.13, bedded=True)
        place = Place(0.0, GROUND_Y + height / 2, 3.2 + 0.4 * number)
        steps.append(Part(name, "limestone", shape, (place,)))
    return [
        Part("slab", "pale stone", slab, pale),
        Part("red slab", "terracotta", slab, red),
        Part("bed", "limestone", bed, (Place(0.0, -0.42 + MORTAR, -0.3),)),
        *steps,
        Part("ground", "sand", ground, (Place(0.0, GROUND_Y, 0.2995),)),
        Part("footing", "sand", footing, (Place(0.0, GROUND_Y - 0.02, 0.2995),)),
    ]


def _walls() -> list[Part]:
    niche = apse((3.2, 4.2), 1.0, 0.85, 1.2, 0.11)
    door = arched_wall((2.4, 4.2, 0.45), 0.75, 2.1, 0.12, edge=0.04)
    cornice = stone((8.3, 0.22, 0.75), 0.05, 0.15)
    return [
        Part("niche", "limestone", niche, (Place(0.0, MORTAR, WALL_Z),)),
        Part("door", "limestone", door, tuple(Place(x, MORTAR, WALL_Z) for x in (-2.8, 2.8))),
        Part("cornice", "pale stone", cornice, (Place(0.0, 4.31 + 2 * MORTAR, WALL_Z - 0.2),)),
    ]


def _colonnades() -> list[Part]:
    rows = [FIRST_COLUMN_Z + BAY * k for k in range(4)]
    left = [Place(-SIDE_X, MORTAR, z) for z in rows]
    right = [Place(SIDE_X, MORTAR, z) for z in rows[:2]]
    top = COLUMN_HEIGHT + 2 * MORTAR
    spans = [Place(-SIDE_X + 0.25, top, z + BAY / 2, 90.0) for z in rows[:3]]
    spans += [Place(SIDE_X + 0.25, top, rows[0] + BAY / 2, 90.0)]
    bay = arched_wall((BAY, 1.2, 0.5), 0.68, 0.0, 0.11, edge=0.04)
    pier = stone((0.56, 1.2, 0.5), 0.03, 0.12)
    piers = tuple(Place(x, top + 0.6, z) for x, z in ((-SIDE_X, rows[3]), (SIDE_X, rows[1])))
    long, short = (stone((0.72, 0.2, z), 0.05, 0.15) for z in (3 * BAY + 0.62, BAY + 0.62))
    coping = Place(-SIDE_X, top + 1.3 + MORTAR, rows[0] + 1.5 * BAY + 0.1)
    short_coping = Place(SIDE_X, top + 1.3 + MORTAR, rows[0] + BAY / 2 + 0.1)
    stump = (Place(SIDE_X, MORTAR, rows[2]),)
    return [
        Part("column", "pale stone", _column(COLUMN_HEIGHT, with_capital=True), (*left, *right)),
        Part("stump", "pale stone", _column(1.15, with_capital=False), stump),
        Part("bay", "limestone", bay, tuple(spans)),
        Part("pier", "limestone", pier, piers),
        Part("coping", "pale stone", long, (coping,)),
        Part("short coping", "pale stone", short, (short_coping,)),
    ]


def _furniture() -> list[Part]:
    well = [(0.86, 0.0), (0.86, 0.14), (0.72, 0.2), (0.70, 0.62), (0.84, 0.68), (0.84, 0.84)]
    well += [(0.56, 0.84), (0.56, 0.1)]
    plinth = [(0.34, 0.0), (0.34, 0.07), (0.22, 0.12), (0.18, 0.26), (0.26, 0.33), (0.0, 0.33)]
    pots = (
        Place(2.2, MORTAR, 2.15),
        Place(2.75, MORTAR, 1.7, 70.0, 0.7),
        Place(-1.75, MORTAR, -2.4, 30.0, 1.3),
        Place(1.8, -0.22 + MORTAR, 3.6, 10.0, 0.6),
        Place(-2.4, MORTAR, 2.4, 45.0, 0.9),
    )
    alcove_z = WALL_Z - 0.44
    well_place = (Place(-0.4, MORTAR, 0.5),)
    surface = turned(_profile([(0.55, 0.45), (0.0, 0.45)], 0.01, 0.1), 48)
    return [
        Part("sphere", "glaze", ball(0.42, 48), (Place(0.0, 1.745 + MORTAR, alcove_z),)),
        Part(
            "plinth",
            "pale stone",
            _turned(plinth, 0.04, 36),
            (Place(0.0, 1.0 + 2 * MORTAR, alcove_z),),
        ),
        Part("well", "limestone", _turned(well, 0.05, 56), well_place),
        Part("water", "water", surface, well_place),
        Part("pot", "terracotta", _pot(), pots),
        Part("bench", "cedar", _bench(), (Place(0.0, MORTAR, WALL_Z + 0.42),)),
    ]


def _pot() -> Patch:
    """Outside from the foot up, over the lip, and down the inside."""
    outside = [(0.0, 0.0), (0.15, 0.0), (0.40, 0.36), (0.13, 0.58), (0.12, 0.68), (0.20, 0.76)]
    inside = [(0.17, 0.765), (0.09, 0.67), (0.10, 0.58), (0.35, 0.36), (0.10, 0.04), (0.0, 0.04)]
    body = _profile(outside, 0.16, 0.08)
    return joined(turned(body, 32), turned(_profile([outside[-1], *inside], 0.1, 0.08), 32))


def _column(height: float, *, with_capital: bool) -> Patch:
    shaft = height - (0.42 if with_capital else 0.0)
    corners = [(0.30, 0.12), (0.31, 0.21), (0.245, 0.24), (0.265, 0.29), (0.235, 0.33)]
    corners += [(0.228, 0.4), (0.228 - 0.016 * shaft, shaft)]
    flutes = Flutes(12, 0.03, 0.36, shaft - 0.04)
    base = stone((0.68, 0.12, 0.68), 0.02, 0.11).moved(y=0.06)
    if not with_capital:
        return joined(
            base, turned(_profile([*corners, (0.0, shaft + 0.03)], 0.02, 0.16), 36, flutes)
        )
    corners += [(0.22, shaft + 0.03), (0.22, shaft + 0.07), (0.185, shaft + 0.1)]
    corners += [(0.29, height - 0.16), (0.29, height - 0.13)]
    abacus = stone((0.64, 0.14, 0.64), 0.03, 0.11).moved(y=height - 0.07)
    return joined(base, turned(_profile(corners, 0.02, 0.16), 36, flutes), abacus)


def _bench() -> Patch:
    seat = stone((2.2, 0.07, 0.42), 0.015, 0.1).moved(y=0.44)
    leg = stone((0.09, 0.42, 0.36), 0.012, 0.1).moved(y=0.21)
    return joined(seat, leg.moved(x=-0.9), leg.moved(x=0.9))


def _turned(corners: list[tuple[float, float]], radius: float, segments: int) -> Patch:
    return turned(_profile(corners, radius, 0.1), segments)


def _profile(corners: list[tuple[float, float]], radius: float, step: float) -> FloatArray:
    return rounded_path(np.array(corners), radius, step)


def _transform(place: Place) -> FloatArray:
    turn = np.radians(place.turn_deg)
    c, s = place.scale * np.cos(turn), place.scale * np.sin(turn)
    matrix = np.array(
        [[c, 0, s, place.x], [0, place.scale, 0, place.y], [-s, 0, c, place.z], [0, 0, 0, 1]]
    )
    return matrix.astype(np.float64)

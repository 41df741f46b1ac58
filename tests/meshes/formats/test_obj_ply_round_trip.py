"""What is written holds the values, and everything else is the file that was read."""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats import check_target, load, write_vertex_ao
from aobake.settings import Store, StoreSettings

Ao = NDArray[np.float32]
# 0 and 1, what a byte and six digits round, the smallest float32, and halves between two bytes.
HURTING = np.array([0.0, 1.0, 1 / 3, 1e-45, 0.5 / 255, 254.5 / 255, 0.99999994], np.float32)
COORDINATES = [
    "0.1 1e-40 -0.0",
    "1 0 0",
    "1.0000000000000001 1 0",
    "nan 0 0",
    "3e38 .5 5.",
    "9 9 9",
    "8 8 8",
]


def round_trip(tmp_path: Path, name: str, data: bytes, ao: Ao, store: Store = "color") -> bytes:
    """Write a file with ambient occlusion into another folder; the bytes of the result.

    Checks that the input is untouched, that the result is read as the same mesh, and that a second run gives
    the same bytes.
    """
    source, target = tmp_path / name, tmp_path / "out" / name
    target.parent.mkdir(exist_ok=True)
    source.write_bytes(data)
    scene = load(source)
    settings = StoreSettings(store=store)
    assert write_vertex_ao(scene, [ao], target, settings) == (target,)
    written = target.read_bytes()
    assert hashlib.sha256(source.read_bytes()).digest() == hashlib.sha256(data).digest()
    before, after = scene.meshes[0], load(target).meshes[0]
    assert_array_equal(after.vertices, before.vertices)
    assert_array_equal(after.faces, before.faces)
    assert (after.normals is None) == (before.normals is None)
    write_vertex_ao(load(source), [ao], target, settings)
    assert target.read_bytes() == written
    assert [file.name for file in target.parent.iterdir()] == [name]
    return written


# ------------------------------------------------------------------------------------------------ OBJ

OBJ = (
    "\ufeff# kept: é \t \n\nmtllib missing.mtl\no thing\n"
    + "".join(f"v  {xyz}\t \n" for xyz in COORDINATES[:5])
    + "\t v 9 9 9 # last\nvt .5 .5 0\nv 8 8 \\\n8\nvn 0 0 1\ng a  b\ns off\nusemtl W\\x\n"
    + "f 1/1 2/1 3/1\\\n 5/1\nl 1 2\nend"
)


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_an_obj_file_gains_colors_and_nothing_else(tmp_path: Path, newline: str) -> None:
    data = OBJ.replace("\n", newline).encode()
    written = round_trip(tmp_path, "a.obj", data, HURTING)
    color = re.compile(rb" (\S+) \1 \1(?=[\t\r\n]| #)")
    found = [float(match.group(1)) for match in color.finditer(written)]
    assert_allclose(found, HURTING, rtol=1e-5, atol=1e-9)
    assert color.sub(b"", written) == data


@pytest.mark.parametrize("white", [1.0, 255.0])
def test_colors_of_an_obj_file_are_multiplied_in_their_own_range(
    tmp_path: Path, white: float
) -> None:
    """A vertex without a colour counts as white in the range that the others use."""
    colors = [[1.0, 0.5, 0.25], [0.2, 0.0, 1.0]]
    shown = [" ".join(f"{part * white:g}" for part in color) for color in colors]
    text = f"v 0 0 0  {shown[0]} \nv 1 0 0 {shown[1]} 0.75\nv 0 1 0\nf 1 2 3\n"
    ao = np.array([0.5, 0.1, 0.25], np.float32)
    lines = round_trip(tmp_path, "a.obj", text.encode(), ao).decode().splitlines()
    values = [[float(word) for word in line.split()[1:]] for line in lines[:3]]
    assert_allclose(values[0][3:], np.array(colors[0]) * white * 0.5, rtol=1e-5)
    assert_allclose(values[1][3:6], np.array(colors[1]) * white * 0.1, rtol=1e-5)
    assert values[1][6] == 0.75  # alpha
    assert_allclose(values[2][3:], [white * 0.25] * 3, rtol=1e-5)
    assert lines[0].startswith("v 0 0 0  ")
    assert lines[0].endswith(" ")


def test_the_weight_of_a_vertex_makes_room_for_its_color(tmp_path: Path) -> None:
    """x y z w r g b is read as x y z and the colour w r g everywhere, and w says nothing about a polygon."""
    text = b"v 0 0 0 1.0\nv 1 0 0 1.0 \nv 0 1 0 1\nf 1 2 3\n"
    written = round_trip(tmp_path, "a.obj", text, np.full(3, 0.5, np.float32))
    assert written == b"v 0 0 0 .5\nv 1 0 0 .5 \nv 0 1 0 .5\nf 1 2 3\n".replace(
        b".5", b"0.5 0.5 0.5"
    )


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("v 0 0 0 1 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "five numbers"),
        ("v 0 0 0 2\nv 1 0 0\nv 0 1 0\nf 1 2 3\ncurv 0 1 1 2\n", "weights"),
    ],
)
def test_a_vertex_line_without_room_is_refused(tmp_path: Path, text: str, finding: str) -> None:
    (tmp_path / "a.obj").write_text(text)
    scene = load(tmp_path / "a.obj")
    with pytest.raises(OutputError, match=finding):
        check_target(scene, tmp_path / "b.obj", StoreSettings())
    with pytest.raises(OutputError, match=finding):
        write_vertex_ao(scene, [np.ones(3, np.float32)], tmp_path / "b.obj", StoreSettings())
    assert not (tmp_path / "b.obj").exists()


# ------------------------------------------------------------------------------------------------ PLY

XYZ: list[list[float]] = [
    [0.1, 1e-40, -0.0],
    [1, 0, 0],
    [1, 1, 0],
    [np.nan, 0, 0],
    [3e38, 0.5, 5],
    [9, 9, 9],
    [8, 8, 8],
]
RGB = [
    [255, 128, 0],
    [1, 2, 3],
    [200, 99, 5],
    [7, 0, 255],
    [51, 102, 153],
    [0, 0, 0],
    [254, 255, 1],
]
FACES = [[0, 1, 2], [0, 1, 2, 5], [6, 5, 4]]
TYPES = {"uchar": "B", "ushort": "H", "float": "f", "double": "d", "int": "i", "char": "b"}
ORDERS = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}


@dataclass(frozen=True)
class Field:
    """A property of the vertices and its values; whether a bake wrote them, and whether it is new."""

    kind: str
    name: str
    values: list[float]
    written: bool = False
    new: bool = False

    def line(self) -> str:
        return (
            f"property {self.kind} {self.name}"
            if self.new
            else f"property  {self.kind}\t{self.name} "
        )

    def word(self, number: int) -> bytes:
        value = self.values[number]
        text = (
            b"%.7g" % value if self.written and self.kind in ("float", "double") else b"%r" % value
        )
        return (b" " if self.new else b"  ") + text


def coordinates() -> list[Field]:
    kinds = ("double", "float", "float")
    return [
        Field(kind, name, [row[axis] for row in XYZ])
        for axis, (kind, name) in enumerate(zip(kinds, "xyz", strict=True))
    ]


def colors(kinds: tuple[str, str, str], ao: Ao | None = None) -> list[Field]:
    """The colours above, times ambient occlusion where it is given."""
    found = []
    for axis, (kind, name) in enumerate(zip(kinds, ("red", "green", "blue"), strict=True)):
        values: list[float] = [row[axis] for row in RGB]
        if ao is not None:
            exact = np.array(values) * ao.astype(float)
            values = (
                exact.tolist()
                if kind in ("float", "double")
                else np.rint(exact).astype(int).tolist()
            )
        if kind == "float":
            values = np.array(values, np.float32).tolist()
        found.append(Field(kind, name, values, written=ao is not None))
    return found


def white(ao: Ao) -> list[Field]:
    """New colours that are ambient occlusion alone."""
    shown = np.rint(ao.astype(float) * 255).astype(int).tolist()
    return [Field("uchar", name, shown, new=True) for name in ("red", "green", "blue")]


def occlusion(ao: Ao, kind: str = "float", new: bool = True) -> Field:
    return Field(kind, "ao", ao.tolist(), written=True, new=new)


def ply(order: str, fields: list[Field], listed: bool = False) -> bytes:
    """A PLY file with these properties of its vertices, in struct's byte order, "" for text.

    listed : gives each vertex a list as well, of a length of its own, before what is new
    """
    old, new = [f for f in fields if not f.new], [f for f in fields if f.new]
    lines = ["ply", f"format {ORDERS[order]} 1.0", "comment kept \t as is ", "element first 1"]
    lines += ["property list uchar double d", "element  vertex 7", *(f.line() for f in old)]
    lines += ["property list uchar short extra"] * listed + [f.line() for f in new]
    lines += [
        "obj_info kept",
        "element face 3",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    body = _row(order, "Bdd", [2, 1.5, 2.5])
    for number in range(7):
        extra = [number, *range(number)] * listed
        if order:
            code = "".join(TYPES[f.kind] for f in old) + f"B{number}h" * listed
            code += "".join(TYPES[f.kind] for f in new)
            values = [f.values[number] for f in old] + extra + [f.values[number] for f in new]
            body += struct.pack(order + code, *values)
        else:
            words = [f.word(number) for f in old] + [b"  %d" % value for value in extra]
            body += b"".join(words + [f.word(number) for f in new])[2:] + b" \n"
    for face in FACES:
        body += _row(order, f"B{len(face)}i", [len(face), *face])
    return "\n".join([*lines, ""]).encode() + body + (b"\0after" if order else b"\n")


def _row(order: str, code: str, values: list[float]) -> bytes:
    if order:
        return struct.pack(order + code, *values)
    return b"  ".join(b"%r" % value for value in values) + b" \n"


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("order", ["", "<", ">"])
class TestPly:
    """The expected file is made by the writer of these tests, with the properties that a bake promises."""

    def test_new_colors_come_last(self, tmp_path: Path, order: str, listed: bool) -> None:
        before = coordinates()
        after = [*before, *white(HURTING), occlusion(HURTING)]
        written = round_trip(tmp_path, "a.ply", ply(order, before, listed), HURTING)
        assert written == ply(order, after, listed)

    def test_an_attribute_is_one_property(self, tmp_path: Path, order: str, listed: bool) -> None:
        before = [*colors(("uchar", "uchar", "uchar")), *coordinates()]
        data = ply(order, before, listed)
        written = round_trip(tmp_path, "a.ply", data, HURTING, "attribute")
        assert written == ply(order, [*before, occlusion(HURTING)], listed)

    @pytest.mark.parametrize("kinds", [("uchar",) * 3, ("float", "ushort", "double")])
    def test_colors_are_multiplied_in_their_own_type(
        self, tmp_path: Path, order: str, listed: bool, kinds: tuple[str, str, str]
    ) -> None:
        old, new = colors(kinds), colors(kinds, HURTING)
        x, y, z = coordinates()
        data = ply(order, [old[0], x, old[1], y, old[2], z], listed)
        written = round_trip(tmp_path, "a.ply", data, HURTING)
        assert written == ply(order, [new[0], x, new[1], y, new[2], z, occlusion(HURTING)], listed)

    def test_the_order_of_the_properties_does_not_matter(
        self, tmp_path: Path, order: str, listed: bool
    ) -> None:
        (red, green, blue), (x, y, z) = colors(("uchar",) * 3), coordinates()
        old = [Field("float", "ao", [0.5] * 7), x, blue, y, green, red, z]
        (red, green, blue) = colors(("uchar",) * 3, HURTING)
        new = [occlusion(HURTING, new=False), x, blue, y, green, red, z]
        written = round_trip(tmp_path, "a.ply", ply(order, old, listed), HURTING)
        assert written == ply(order, new, listed)

    @pytest.mark.parametrize("kind", ["float", "double"])
    def test_an_ao_of_before_is_overwritten(
        self, tmp_path: Path, order: str, listed: bool, kind: str
    ) -> None:
        x, y, z = coordinates()
        old = Field(kind, "ao", [0.125] * 7)
        written = round_trip(
            tmp_path, "a.ply", ply(order, [x, old, y, z], listed), HURTING, "attribute"
        )
        assert written == ply(order, [x, occlusion(HURTING, kind, new=False), y, z], listed)

    @pytest.mark.parametrize("place", [0, 1, 3])
    def test_an_ao_in_whole_numbers_gives_way_to_a_float(
        self, tmp_path: Path, order: str, listed: bool, place: int
    ) -> None:
        before = coordinates()
        before.insert(place, Field("int", "ao", [7] * 7))
        written = round_trip(tmp_path, "a.ply", ply(order, before, listed), HURTING, "attribute")
        assert written == ply(order, [*coordinates(), occlusion(HURTING)], listed)


def test_the_header_keeps_its_line_ends_and_its_names_of_types(tmp_path: Path) -> None:
    head = "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\n" + "".join(
        f"property float32 {name}\r\n" for name in "xyz"
    )
    rest = "element face 1\r\nproperty list uint8 int32 vertex_indices\r\nend_header\r\n"
    body = "0 0 0{0}\r\n1 0 0{0}\r\n0 1 0{0}\r\n3 0 1 2\r\n"
    written = round_trip(
        tmp_path,
        "a.ply",
        (head + rest + body.format("")).encode(),
        np.ones(3, np.float32),
        "attribute",
    )
    assert written == (head + "property float32 ao\r\n" + rest + body.format(" 1")).encode()


def test_colors_in_part_are_refused_and_an_attribute_is_the_cure(tmp_path: Path) -> None:
    data = ply("<", [*coordinates(), colors(("uchar", "uchar", "uchar"))[0]])
    (tmp_path / "a.ply").write_bytes(data)
    scene = load(tmp_path / "a.ply")
    with pytest.raises(OutputError, match=r"have red of red, green and blue.*--store attribute"):
        check_target(scene, tmp_path / "b.ply", StoreSettings())
    write_vertex_ao(scene, [HURTING], tmp_path / "b.ply", StoreSettings(store="attribute"))


@pytest.mark.parametrize("name", ["a.obj", "a.ply"])
def test_values_for_another_number_of_vertices_are_refused(tmp_path: Path, name: str) -> None:
    data = ply("", coordinates()) if name.endswith("ply") else OBJ.encode()
    (tmp_path / name).write_bytes(data)
    scene = load(tmp_path / name)
    for wrong in (np.ones(6, np.float32), np.ones(8, np.float32)):
        with pytest.raises(OutputError, match="bake it again"):
            write_vertex_ao(scene, [wrong], tmp_path / f"out{name[1:]}", StoreSettings())


def test_colors_that_were_baked_before_are_darkened_again_and_it_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(ply("<", coordinates()))
    settings, target = StoreSettings(), tmp_path / "c.ply"
    assert check_target(load(tmp_path / "a.ply"), target, settings) == ()
    write_vertex_ao(load(tmp_path / "a.ply"), [HURTING], tmp_path / "b.ply", settings)
    found = check_target(load(tmp_path / "b.ply"), target, settings)
    assert len(found) == 1
    assert "b.ply: the vertices have a property ao" in found[0]
    assert check_target(load(tmp_path / "b.ply"), target, StoreSettings(store="attribute")) == ()

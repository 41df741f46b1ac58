"""A lightmap into an OBJ file: its coordinates, a material library of its own, and the image."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from aobake.errors import OutputError
from aobake.files import Content, check_writable, make_folder, write_files
from aobake.meshes.formats.beside import copies_beside
from aobake.meshes.formats.obj.coordinates import Change, new_coordinates
from aobake.meshes.formats.obj.fresh_lightmap import fresh_lightmap
from aobake.meshes.formats.obj.geometry import Geometry, parse
from aobake.meshes.formats.obj.library import with_occlusion
from aobake.meshes.formats.obj.names import Names, names_beside
from aobake.meshes.formats.obj.source import ObjSource
from aobake.meshes.formats.obj.statements import UTF8_MARK, blocks
from aobake.meshes.formats.tokens import spliced
from aobake.meshes.lightmap import Lightmap, Unwrapped
from aobake.meshes.scene import Scene
from aobake.settings import Encoding, ImageSettings

__all__ = ["check_texture", "write_texture"]

ENDINGS: Mapping[Encoding, str] = {"half": ".exr", "float": ".exr"}  # and PNG for the others
MATERIAL = b"ambient_occlusion"  # of faces that have none


def check_texture(
    scene: Scene, image: ImageSettings, target: Path, lightmap: Lightmap | None = None
) -> tuple[str, ...]:
    """Raise OutputError for side files that are in the way, and for textures that would lose their coordinates.

    lightmap : None before the bake, when its layout is not known
    Returns what the caller should know about the result, one line each.
    """
    check_writable(target)
    if isinstance(scene.source, ObjSource):
        _copies(scene.source, target)
        if lightmap is not None:
            _check_textures(scene, lightmap, target)
    if lightmap is not None:
        _check_tangents(scene, lightmap, target)
    if image.pack == "orm":
        return (f"{target}: OBJ has its occlusion in an image of its own; only glTF is packed",)
    return ()


def _check_textures(scene: Scene, lightmap: Lightmap, target: Path) -> None:
    """OBJ has one set of texture coordinates: a new one would take that of the textures away."""
    textured = any(
        texture is not None
        for material in scene.materials
        for texture in (
            material.base_color_texture,
            material.normal_texture,
            material.emissive_texture,
        )
    )
    if textured and any(isinstance(p.layout, Unwrapped) for p in lightmap.placings if p):
        raise OutputError(
            f"{target}: OBJ has one set of texture coordinates, which its textures need, and the occlusion needs "
            "another one. Keep the set (--uv keep), or bake to vertex colors (aobake vertex)."
        )


def _check_tangents(scene: Scene, lightmap: Lightmap, target: Path) -> None:
    """Directions along tangents mean nothing where a new set takes away the coordinates that those follow."""
    if lightmap.bent is None or lightmap.bent.space != "tangent":
        return
    for (_, mesh), placing in zip(scene.placed(), lightmap.placings, strict=True):
        old = {"TANGENT", "TEXCOORD_0"} & mesh.attributes.keys()
        if old and placing is not None and isinstance(placing.layout, Unwrapped):
            raise OutputError(
                f"{target}: OBJ has one set of texture coordinates, and the bent normals follow the old one of mesh "
                f"{mesh.name!r}. Keep it (--uv keep), bake them with --bent-space object, or write GLB."
            )


def write_texture(
    scene: Scene, lightmap: Lightmap, target: Path, image: ImageSettings
) -> tuple[Path, ...]:
    """Write the scene's OBJ file with its lightmap, or a new one where it was read from no OBJ file.

    Returns the files written, the target first, then the material library, the images, and textures copied
    beside it. Raises OutputError; nothing is half-written.
    """
    check_texture(scene, image, target, lightmap)
    source = scene.source if isinstance(scene.source, ObjSource) else None
    copies = _copies(source, target) if source else {}
    names = names_beside(
        target,
        ENDINGS.get(image.encoding or "8", ".png"),
        len(lightmap.pages),
        0 if lightmap.bent is None else len(lightmap.pages),
        {*copies, *(source.files if source else ())},
    )
    texts = (
        _patched(source, lightmap, names, target)
        if source
        else fresh_lightmap(scene, lightmap, names, target)
    )
    asset = texts.pop(target)
    beside: dict[Path, Content] = {**texts, **_images(lightmap, image, names), **copies}
    for path in beside:
        make_folder(path.parent, needed_by=target.name)
    write_files({**beside, target: asset})
    return (target, *beside)


def _images(lightmap: Lightmap, image: ImageSettings, names: Names) -> dict[Path, bytes]:
    from aobake.images import KINDS, encode  # heavy: a vertex bake does without

    used = sorted({placing.page for placing in lightmap.placings if placing})
    kept = [(names.images[page], lightmap.pages[page]) for page in used]
    if lightmap.bent is not None:
        kept += [(names.bent[page], lightmap.bent.image(page)) for page in used]
    return {path: encode(pixels, KINDS[path.suffix], image.encoding) for path, pixels in kept}


def _patched(
    source: ObjSource, lightmap: Lightmap, names: Names, target: Path
) -> dict[Path, bytes]:
    """The OBJ file and its material library."""
    placing = lightmap.placings[0]
    if placing is None:  # nothing to be seen
        return {target: source.text}
    where, text = str(source.path), source.text
    line_end = b"\r\n" if b"\r\n" in text else b"\n"
    geometry = parse(text, where)
    changes = _library_named(text, names.library.name.encode(), line_end, where)
    materials, unnamed = _materials(geometry)
    if unnamed is not None:
        changes.append(Change(unnamed, unnamed, b"usemtl " + MATERIAL + line_end))
    if isinstance(placing.layout, Unwrapped):
        changes += new_coordinates(text, geometry, placing.layout, line_end, where)
    changes.sort(key=lambda change: (change.start, change.end))
    library = b"\n".join(path.read_bytes() for path in _libraries(source))
    image = names.images[placing.page].name.encode()
    bent = names.bent[placing.page].name.encode() if names.bent else None
    return {
        names.library: with_occlusion(library, materials, image, bent),
        target: spliced(
            text,
            (change.start for change in changes),
            (change.end for change in changes),
            (change.new for change in changes),
        ),
    }


def _materials(geometry: Geometry) -> tuple[list[bytes], int | None]:
    """Names of the materials of all faces, and where the first face without one stands (None: there is none)."""
    places = geometry.places[geometry.sizes > 2]
    starts = np.array([place for place, _ in geometry.uses], np.int64)
    held = np.unique(np.searchsorted(starts, places)).tolist()
    names = [MATERIAL, *(name for _, name in geometry.uses)]
    unnamed = int(places[0]) if held[:1] == [0] else None
    return list(dict.fromkeys(names[number] for number in held)), unnamed


def _library_named(text: bytes, name: bytes, line_end: bytes, where: str) -> list[Change]:
    """What has the file name one library alone: in place of its first mtllib, or at its beginning."""
    spans = list(_statements(text, b"mtllib", where))
    if not spans:
        start = len(UTF8_MARK) if text.startswith(UTF8_MARK) else 0
        return [Change(start, start, b"mtllib " + name + line_end)]
    (start, end), *others = spans
    return [
        Change(start, end, b"mtllib " + name),
        *(Change(begin, begin, b"# ") for begin, _ in others),
    ]


def _statements(text: bytes, keyword: bytes, where: str) -> Iterator[tuple[int, int]]:
    """The span of each statement that begins with a word."""
    for block in blocks(text, where):
        for number in np.flatnonzero(block.keyword(keyword)).tolist():
            first = block.first[number]
            last = first + block.words[number] - 1
            yield int(block.starts[first]) + block.offset, int(block.ends[last]) + block.offset


def _libraries(source: ObjSource) -> list[Path]:
    """The material libraries among the files of a source."""
    named = {
        (source.path.parent / spelling).absolute()
        for start, end in _statements(source.text, b"mtllib", str(source.path))
        for spelling in _spellings(source.text[start:end])
    }
    return [path for path in source.files[1:] if path.absolute() in named]


def _spellings(statement: bytes) -> Iterable[str]:
    """Every name that a mtllib statement may mean: one with spaces, or several."""
    rest = statement.partition(b"mtllib")[2].strip()
    for encoding in ("utf-8", "latin-1"):
        name = rest.decode(encoding, "replace")
        for spelling in (name, *name.split()):
            yield spelling
            yield spelling.replace("\\", "/")


def _copies(source: ObjSource, target: Path) -> dict[Path, bytes]:
    """Textures that go along into another folder; the libraries are written anew."""
    libraries = set(_libraries(source))
    return copies_beside(
        source.path, [path for path in source.files[1:] if path not in libraries], target
    )

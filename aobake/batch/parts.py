"""Parts of one texture bake, which several workers share: its layout, its bands traced, and all put together.

Parts hand on what they have made through files beside the output, so that neither the network between
workers nor the caller's memory ever holds a whole page. Each file carries a code that only those who have
the key of the bake can make: a pickle from elsewhere is never opened.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import pickle
import secrets
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal, cast

from aobake.errors import InputError
from aobake.files import UNFINISHED, write_files

if TYPE_CHECKING:
    from aobake.atlas.layout import Layout
    from aobake.jobs import Bake, Job, Progress
    from aobake.lightmaps import TracedBand
    from aobake.meshes.scene import Scene
    from aobake.results import BakedTexture
    from aobake.settings import BakeSettings

__all__ = ["Part", "Step", "first_part", "join_bake", "make_part"]

Step = Literal["layout", "trace", "join"]

LENGTH = struct.Struct("<Q")
CODE_BYTES = hashlib.sha256().digest_size
KEY_BYTES = 32


@dataclass(frozen=True, kw_only=True)
class Part:
    """One step of a texture bake in tiles.

    step : lay out the charts; trace tile `number` of `count`; or put all together
    stem : how the names of all files begin that parts hand on, relative to the folder of all outputs
    key : what their files are signed with
    """

    step: Step
    number: int
    count: int
    stem: str
    key: bytes = field(repr=False)

    @property
    def makes(self) -> str:
        """The file that it hands on, '' where it makes none; named as `needs` are."""
        return {"layout": self.layout, "trace": self.tile(self.number), "join": ""}[self.step]

    @property
    def needs(self) -> tuple[str, ...]:
        """The files of other parts that it needs, relative to the folder of all outputs."""
        return {"layout": (), "trace": (self.layout,), "join": self.files}[self.step]

    @property
    def files(self) -> tuple[str, ...]:
        """All files that parts of this bake hand on, whether they are there yet or not."""
        return (self.layout, *(self.tile(number) for number in range(self.count)))

    @property
    def layout(self) -> str:
        """The file with the layout."""
        return f"{self.stem}-layout__.part"

    def tile(self, number: int) -> str:
        """The file with the bands of a tile."""
        return f"{self.stem}-tile{number:04}.part"


def first_part(output: str, count: int) -> Part:
    """The layout of a bake that will be cut into `count` tiles.

    output : the file to be written, relative to the folder of all outputs
    """
    folder, slash, _ = output.rpartition("/")
    # Names of unfinished files: should this run be killed, the next one removes them like any other.
    stem = f"{folder}{slash}{UNFINISHED}{secrets.token_hex(4)}"
    key = secrets.token_bytes(KEY_BYTES)
    return Part(step="layout", number=0, count=count, stem=stem, key=key)


def make_part(part: Part, job: Job, target: Path) -> None:
    """Do the first or the second step of a bake: make the file that it hands on.

    target : the folder of all outputs
    Raises what load and bake_texture do, and InputError where a file of another part is not sound.
    """
    from aobake.jobs import opened
    from aobake.lightmaps import bands_of, prepare_texture, trace_bands

    scene, settings = opened(job, {}), job.chosen.bake
    if part.step == "layout":
        made: Iterable[object] = [prepare_texture(scene, settings).layout]
    else:
        bake = prepare_texture(scene, settings, layout=_layout(part, target))
        # Dealt out like cards: rows of one region cost alike, so every tile gets of each.
        made = trace_bands(bake, bands_of(bake)[part.number :: part.count])
    records = [piece for item in made for piece in _record(item, part, part.makes)]
    write_files({target / part.makes: records})


def join_bake(part: Part, target: Path) -> Bake:
    """The bake of the last step, for run_job in place of bake_texture: byte by byte as good.

    target : the folder of all outputs
    It traces nothing. It raises what bake_texture does, and InputError where a file of another part is not
    sound.
    """
    from aobake.lightmaps import prepare_texture, put_together

    def bake(
        scene: Scene, settings: BakeSettings, *, progress: Progress | None = None
    ) -> BakedTexture:
        layout = _layout(part, target)
        prepared = prepare_texture(scene, settings, layout=layout, progress=progress)
        return put_together(prepared, _traced(part, target))

    return bake


def _layout(part: Part, target: Path) -> Layout:
    with (target / part.layout).open("rb") as stream:
        return cast("Layout", next(_records(stream, part, part.layout)))


def _traced(part: Part, target: Path) -> Iterator[TracedBand]:
    """All bands in their order, so that pages are finished one after another."""
    with contextlib.ExitStack() as stack:
        names = [part.tile(number) for number in range(part.count)]
        streams = [stack.enter_context((target / name).open("rb")) for name in names]
        waiting = [
            _records(stream, part, name) for stream, name in zip(streams, names, strict=True)
        ]
        while waiting:
            for tile in list(waiting):
                band = next(tile, None)
                if band is None:
                    waiting.remove(tile)
                else:
                    yield cast("TracedBand", band)


def _record(item: object, part: Part, name: str) -> tuple[bytes, bytes, bytes]:
    """A pickle with its length and its code before it."""
    content = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(content)), _code(content, part, name), content


def _records(stream: BinaryIO, part: Part, name: str) -> Iterator[object]:
    """What another part of the same bake has made. Raises InputError where it is not that."""
    while head := stream.read(LENGTH.size):
        code = stream.read(CODE_BYTES)
        content = stream.read(*LENGTH.unpack(head)) if len(head) == LENGTH.size else b""
        if not hmac.compare_digest(_code(content, part, name), code):
            raise InputError(f"{name}: this part of a bake is not as it was made. Bake it again.")
        yield pickle.loads(content)  # noqa: S301 - signed by a part of this bake


def _code(content: bytes, part: Part, name: str) -> bytes:
    code = hmac.new(part.key, name.encode("utf-8", "surrogateescape"), "sha256")
    code.update(content)
    return code.digest()

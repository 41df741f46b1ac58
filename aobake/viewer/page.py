"""The page itself: text around a GLB and the viewer, all in one file."""

from __future__ import annotations

import base64
import html
import string
from collections.abc import Sequence
from importlib.resources import files

from aobake import __version__
from aobake.errors import OutputError
from aobake.meshes.formats.gltf.container import Bytes
from aobake.standalone import hash_source, policy

__all__ = ["page_of", "shared_scripts"]

DRACO = b"KHR_draco_mesh_compression"
MOST_BYTES = (
    256 << 20
)  # browsers hold a text of half a gigabyte, and base64 makes four bytes of three


def page_of(
    glb: Bytes, name: str, facts: Sequence[str] = (), *, scripts_in: str | None = None
) -> bytes:
    """A page that shows a GLB with its ambient occlusion on, off and alone, and asks the network for nothing.

    glb : with everything in it, as packed_glb gives it
    name : title of the page, any text
    facts : what to say below it, each a few words
    scripts_in : the folder of shared_scripts(), relative to the page and with a slash at its end, so that many
        pages can share them; '' is the page's own. None: they are in the page itself
    Returns the HTML file. Its policy forbids every request and every script but these.
    Raises OutputError for a GLB of more than 256 MiB, which browsers could not open.
    """
    if len(glb) > MOST_BYTES:
        raise OutputError(
            f"{name}: it takes {len(glb) >> 20} MiB with all its textures, and a page holds {MOST_BYTES >> 20}. "
            "Use smaller textures, or compress it."
        )
    parts = ["draco", "viewer"] if DRACO in _json_of(glb) else ["viewer"]
    style = _text("page.css")
    scripts, allowed = _scripts(parts, scripts_in)
    rules = policy(
        scripts=[*allowed, "'wasm-unsafe-eval'"],  # decoders are WebAssembly
        styles=[hash_source(style)],
        images=["blob:", "data:"],  # of its own making
    )
    licences = [_vendored(f"{part}.licences.txt") for part in parts if scripts_in is None]
    text = string.Template(_text("page.html")).substitute(
        policy=html.escape(rules),
        version=html.escape(__version__),
        name=html.escape(name),
        facts=html.escape(" · ".join(facts)),
        style=style,
        licences="\n".join(licences),
        asset=base64.b64encode(glb).decode("ascii"),
        scripts="\n".join(scripts),
    )
    return text.encode("utf-8", "replace")  # a name may hold what is no character


def shared_scripts() -> dict[str, bytes]:
    """Name -> content of the scripts of pages that do not carry them, each with its licences."""
    return {
        f"{part}.min.js": f"/*\n{_vendored(f'{part}.licences.txt')}*/\n{_vendored(f'{part}.min.js')}".encode()
        for part in ("draco", "viewer")
    }


def _json_of(glb: Bytes) -> bytes:
    """The JSON of a GLB, which is its first chunk."""
    return bytes(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])


def _scripts(parts: Sequence[str], folder: str | None) -> tuple[list[str], list[str]]:
    """The elements of the scripts, and what the policy has to allow for them."""
    if folder is None:
        code = [_vendored(f"{part}.min.js") for part in parts]
        allowed = [hash_source(script) for script in code]
        return [f"<script>{script}</script>" for script in code], allowed
    # A file beside the page is the page's own, also where it is opened from a disk.
    sources = [html.escape(f"{folder}{part}.min.js") for part in parts]
    return [f'<script src="{source}"></script>' for source in sources], ["'self'"]


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _vendored(name: str) -> str:
    return _text(f"vendor/{name}")

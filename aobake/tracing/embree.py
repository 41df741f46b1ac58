"""Embree's C interface: the one file that knows it.

Embree comes with the package embreex. Its functions are called from compiled kernels through their
addresses (see kernels.py), since a kernel that held a ctypes pointer could not be kept on disk.
Written against Embree 4.4; layouts and constants are those of rtcore_common.h, rtcore_ray.h,
rtcore_geometry.h and rtcore_scene.h, and hold for every 4.x.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import importlib.util
import platform
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aobake.errors import EngineError

__all__ = [
    "Body",
    "Functions",
    "HitFilter",
    "Packets",
    "Tree",
    "build_tree",
    "functions",
    "packets",
    "version",
]

Packets = tuple[int, int, int, int]  # see packets

FORMAT_UINT3, FORMAT_FLOAT3, FORMAT_FLOAT3X4_COLUMN_MAJOR = 0x5003, 0x9003, 0x9234
BUFFER_INDEX, BUFFER_VERTEX = 0, 1
GEOMETRY_TRIANGLE, GEOMETRY_INSTANCE = 0, 121
SCENE_ROBUST = 4
QUALITY_MEDIUM = 1
PROPERTY_VERSION, PROPERTY_NATIVE_RAY16 = 0, 34
INCOHERENT, COHERENT = 0, 1 << 16
ALL_FEATURES = -1
VERTEX_BYTES, FACE_BYTES = 12, 12
READ_AHEAD_BYTES = 16  # Embree loads a vertex with one 16-byte read, also the last one of a buffer

_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (ctypes.c_void_p, [ctypes.c_char_p]),
    "rtcGetDeviceError": (ctypes.c_int, [ctypes.c_void_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [ctypes.c_void_p, ctypes.c_int]),
    "rtcNewScene": (ctypes.c_void_p, [ctypes.c_void_p]),
    "rtcSetSceneFlags": (None, [ctypes.c_void_p, ctypes.c_int]),
    "rtcSetSceneBuildQuality": (None, [ctypes.c_void_p, ctypes.c_int]),
    "rtcCommitScene": (None, [ctypes.c_void_p]),
    "rtcReleaseScene": (None, [ctypes.c_void_p]),
    "rtcNewGeometry": (ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_int]),
    "rtcSetSharedGeometryBuffer": (
        None,
        [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p]
        + [ctypes.c_size_t] * 3,
    ),
    "rtcSetGeometryInstancedScene": (None, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcSetGeometryTransform": (
        None,
        [ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p],
    ),
    "rtcSetGeometryIntersectFilterFunction": (None, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcSetGeometryOccludedFilterFunction": (None, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcSetGeometryUserData": (None, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcCommitGeometry": (None, [ctypes.c_void_p]),
    "rtcAttachGeometryByID": (None, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint]),
    "rtcReleaseGeometry": (None, [ctypes.c_void_p]),
}


@dataclass(frozen=True)
class Functions:
    """Addresses of the functions that kernels call."""

    occluded8: int
    intersect8: int
    occluded16: int
    intersect16: int
    point_query: int


@dataclass(frozen=True, eq=False, kw_only=True)
class HitFilter:
    """What decides, within the traversal, which hits on some triangles count.

    function : address of an RTCFilterFunctionN
    sided : whether it tells fronts from backs
    data : what the function finds at geometryUserPtr, for these triangles and no others; or None
    kept : what `data` holds the addresses of
    """

    function: int
    sided: bool
    data: NDArray[np.int64] | None = None
    kept: tuple[object, ...] = ()


@dataclass(frozen=True, eq=False)
class Body:
    """Triangles for a tree.

    vertices : (V, 3) float32, C-ordered, followed by at least READ_AHEAD_BYTES of readable memory
    faces : (F, 3) uint32, C-ordered
    hit_filter : decides which hits count; None: all do
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    hit_filter: HitFilter | None = None


class Tree:
    """A built scene. `address` is what kernels pass to Embree; it is released with this object."""

    def __init__(self, address: int, kept: Sequence[object]) -> None:
        self.address = address
        self._kept = kept  # shared buffers and the scenes of instances: Embree refers to them
        weakref.finalize(self, _library().rtcReleaseScene, address)


def build_tree(
    bodies: Sequence[Body],
    placed: Sequence[Body],
    instances: Sequence[tuple[int, NDArray[np.float32]]],
) -> Tree:
    """Build Embree's tree over bodies that stand where they are, and instances of others.

    bodies : geometry i of the scene is bodies[i]
    instances : (index into placed, (3, 4) float32 transform); geometry len(bodies) + k is instance k
    The tree is the robust one: closed meshes leak no ray at edges. Raises EngineError.
    Tried: building it in a thread beside the normals. Embree builds in all threads already (39 ms of processors
    for 70,000 triangles, 20 of them in the calling thread), and both together took as long as one after the other.
    Devices with huge pages, threads that start at once, AVX2 alone: 28 ms of processors each, as without.
    """
    library, device = _library(), _device()
    scene = _new_scene()
    parts = []
    for body in placed:
        part = _new_scene()
        _attach_triangles(part, 0, body)
        library.rtcCommitScene(part)
        parts.append(Tree(part, [body]))
    for number, body in enumerate(bodies):
        _attach_triangles(scene, number, body)
    for number, (part_number, transform) in enumerate(instances, start=len(bodies)):
        geometry = library.rtcNewGeometry(device, GEOMETRY_INSTANCE)
        library.rtcSetGeometryInstancedScene(geometry, parts[part_number].address)
        columns = np.ascontiguousarray(transform.T, np.float32)
        library.rtcSetGeometryTransform(
            geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.ctypes.data
        )
        _attach(scene, number, geometry)
    library.rtcCommitScene(scene)
    tree = Tree(scene, [*bodies, *parts])
    _check("building the tree")
    return tree


def version() -> str:
    """Embree's version, such as '4.4.1'."""
    number = _library().rtcGetDeviceProperty(_device(), PROPERTY_VERSION)
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


@functools.cache
def functions() -> Functions:
    """Addresses of the functions that kernels call. Raises EngineError where Embree is missing."""

    def address(name: str) -> int:
        return ctypes.cast(getattr(_library(), name), ctypes.c_void_p).value or 0

    return Functions(
        occluded8=address("rtcOccluded8"),
        intersect8=address("rtcIntersect8"),
        occluded16=address("rtcOccluded16"),
        intersect16=address("rtcIntersect16"),
        point_query=address("rtcPointQuery"),
    )


@functools.cache
def packets(*, coherent: bool = False, lanes: int | None = None) -> Packets:
    """How kernels ask for packets: rtcOccludedN and rtcIntersectN, N, and the address of their arguments.

    coherent : whether rays of a packet meet much the same boxes on their way, so that Embree follows them together
    lanes : 8 or 16; None: 16 where the processor has instructions for as many, since Embree takes others one by one
    """
    if lanes is None:
        lanes = 16 if _library().rtcGetDeviceProperty(_device(), PROPERTY_NATIVE_RAY16) else 8
    found, asked = functions(), _arguments(COHERENT if coherent else INCOHERENT)
    if lanes == 16:
        return found.occluded16, found.intersect16, lanes, asked
    return found.occluded8, found.intersect8, lanes, asked


@functools.cache
def _kept_arguments(flags: int) -> NDArray[np.int32]:
    """RTCOccludedArguments, which begin as RTCIntersectArguments do: flags, features, and nothing else."""
    asked = np.zeros(16, np.int32)
    asked[:2] = flags, ALL_FEATURES
    return asked


def _arguments(flags: int) -> int:
    return int(_kept_arguments(flags).ctypes.data)


def _new_scene() -> int:
    library = _library()
    scene = library.rtcNewScene(_device())
    if not scene:
        _check("making a scene")
    library.rtcSetSceneFlags(scene, SCENE_ROBUST)
    library.rtcSetSceneBuildQuality(scene, QUALITY_MEDIUM)
    return int(scene)


def _attach_triangles(scene: int, number: int, body: Body) -> None:
    library = _library()
    geometry = library.rtcNewGeometry(_device(), GEOMETRY_TRIANGLE)
    for kind, form, array, size in (
        (BUFFER_VERTEX, FORMAT_FLOAT3, body.vertices, VERTEX_BYTES),
        (BUFFER_INDEX, FORMAT_UINT3, body.faces, FACE_BYTES),
    ):
        library.rtcSetSharedGeometryBuffer(
            geometry, kind, 0, form, array.ctypes.data, 0, size, len(array)
        )
    if body.hit_filter is not None:
        library.rtcSetGeometryOccludedFilterFunction(geometry, body.hit_filter.function)
        library.rtcSetGeometryIntersectFilterFunction(geometry, body.hit_filter.function)
        if body.hit_filter.data is not None:
            library.rtcSetGeometryUserData(geometry, body.hit_filter.data.ctypes.data)
    _attach(scene, number, geometry)


def _attach(scene: int, number: int, geometry: int) -> None:
    library = _library()
    library.rtcCommitGeometry(geometry)
    library.rtcAttachGeometryByID(scene, geometry, number)
    library.rtcReleaseGeometry(geometry)


def _check(doing: str) -> None:
    """Raise EngineError for what Embree has noted since the last call."""
    code = _library().rtcGetDeviceError(_device())
    if code:
        reasons = {
            1: "an unknown error",
            2: "an invalid argument",
            3: "an invalid operation",
            4: "out of memory",
            5: "this processor is not supported",
            6: "cancelled",
        }
        raise EngineError(f"Embree, {doing}: {reasons.get(code, f'error {code}')}.")


@functools.cache
def _device() -> int:
    device = _library().rtcNewDevice(b"")
    if not device:
        raise EngineError("Embree cannot be started on this processor; SSE2 or NEON is needed.")
    return int(device)


@functools.cache
def _library() -> ctypes.CDLL:
    """Embree's shared library, with the argument types of all functions that are used."""
    try:
        library = ctypes.CDLL(str(_library_path()))
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EngineError(
            f"Embree's library cannot be loaded ({error}). Reinstall it: pip install --force-reinstall embreex."
        ) from error
    return library


def _library_path() -> Path:
    """A library through which every Embree function is found.

    Looking up a symbol goes on into a module's dependencies on Linux and macOS, so embreex' own
    extension module will do, and the mangled name of the bundled library need not be known. On
    Windows it does not, and the library lies among the installed files.
    """
    module = importlib.util.find_spec("embreex.rtcore_scene") if _installed() else None
    if module is None or module.origin is None:
        raise EngineError(
            "the package embreex, which brings Embree, is not installed. pip install embreex "
            "(it exists for Linux x86-64, macOS and Windows, not for Linux on Arm)."
        )
    if platform.system() != "Windows":
        return Path(module.origin)
    files = importlib.metadata.files("embreex") or []
    found = [
        file for file in files if file.name.lower().startswith("embree4") and file.suffix == ".dll"
    ]
    if not found:
        raise EngineError(
            "embreex is installed without embree4.dll. Reinstall it: pip install embreex."
        )
    return Path(str(found[0].locate()))


def _installed() -> bool:
    return importlib.util.find_spec("embreex") is not None

"""The one file that knows Pixar's library: a stage in, arrays out; arrays in, a layer out.

Nothing is fetched: without further plug-ins the library resolves names to files of this machine alone.
What it has to say is gathered instead of printed.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils, Vt

from aobake.errors import InputError
from aobake.meshes.formats.usd.prims import (
    Colors,
    IndexArray,
    MeshPrim,
    Opened,
    Primvar,
    Values,
    turned,
    without_holes,
)
from aobake.meshes.formats.usd.source import Binding
from aobake.meshes.scene import FloatArray

__all__ = ["colors_of", "layer_names", "layer_over", "opened"]

ScalarT = TypeVar("ScalarT", bound=np.generic)
MARK = "aobake"  # in the custom data of the layers that aobake writes
SHOWN = ("default", "render")  # purposes: guides and proxies are no surfaces
MOST_INSTANCES = 1_000_000
MOST_SAID = 5
ROOT_FIELDS = (  # not composed from sublayers, so a layer over a file has to say them again
    "defaultPrim", "upAxis", "metersPerUnit", "kilogramsPerUnit", "startTimeCode", "endTimeCode",
    "timeCodesPerSecond", "framesPerSecond", "colorConfiguration", "colorManagementSystem",
    "renderSettingsPrimPath", "expressionVariables",
)  # fmt: skip


def opened(path: Path) -> Opened:
    """The meshes of a stage at its earliest time. Raises InputError for what the library cannot read."""
    said: list[str] = []
    with _listening(said):
        stage = _stage(path)
        walk = _Walk(path, stage)
        walk.all()
        root = stage.GetRootLayer()
        layers = [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]
        about = {
            "default prim": root.defaultPrim,
            "up axis": str(UsdGeom.GetStageUpAxis(stage)),
            "meters per unit": f"{UsdGeom.GetStageMetersPerUnit(stage):g}",
        }
        was_baked = MARK in root.customLayerData
    return Opened(
        prims=tuple(walk.found),
        layers=tuple(layers),
        counts=walk.counts,
        said=(*said[:MOST_SAID], *walk.passed_over),
        about=about,
        was_baked=was_baked,
    )


def layer_names(path: Path) -> tuple[str, ...]:
    """The layers that a layer is made of, as it names them; () for what the library cannot read."""
    with _listening([]):
        try:
            layer = Sdf.Layer.OpenAsAnonymous(str(path.resolve()))  # past the library's own cache
        except Tf.ErrorException:
            return ()
        return () if layer is None else tuple(sorted(layer.GetCompositionAssetDependencies()))


def colors_of(path: Path, bindings: Sequence[Binding]) -> list[Colors | None]:
    """The displayColor that each mesh has or inherits; None where there is none."""
    with _listening([]):
        stage = _stage(path)
        return [_colors(stage.GetPrimAtPath(binding.path)) for binding in bindings]


def layer_over(
    path: Path, relative: str, target: str, primvars: Mapping[Binding, Primvar]
) -> bytes:
    """The content of a layer that gives meshes of the file at `path` a primvar each.

    relative : the name by which the layer refers to the file     target : '.usda', '.usd' or '.usdc'
    Native instances that a mesh stands in are no longer shared in the layer, so that each keeps its own.
    """
    with _listening([]):
        below = Sdf.Layer.FindOrOpen(str(path.resolve()))
        layer = Sdf.Layer.CreateAnonymous(".usdc" if target == ".usdc" else ".usda")
        layer.subLayerPaths.append(str(path.resolve()))
        layer.customLayerData = {MARK: {"holds": "ambient occlusion"}}
        for name in ROOT_FIELDS:
            if below.pseudoRoot.HasInfo(name):
                layer.pseudoRoot.SetInfo(name, below.pseudoRoot.GetInfo(name))
        stage = Usd.Stage.Open(layer)
        for instance in dict.fromkeys(i for binding in primvars for i in binding.instances):
            stage.OverridePrim(instance).SetInstanceable(False)
        for binding, primvar in primvars.items():
            _author(stage.OverridePrim(binding.path), primvar)
        layer.subLayerPaths[0] = relative
        return _exported(layer, target)


def _author(prim: Usd.Prim, primvar: Primvar) -> None:
    is_color = primvar.values.ndim == 2
    kinds = Sdf.ValueTypeNames
    made = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        primvar.name, kinds.Color3fArray if is_color else kinds.FloatArray, primvar.interpolation
    )
    if made.IsIndexed():
        made.BlockIndices()
    array = (Vt.Vec3fArray if is_color else Vt.FloatArray).FromNumpy(primvar.values)
    made.Set(array)


def _exported(layer: Sdf.Layer, target: str) -> bytes:
    if target != ".usdc":
        text: str = layer.ExportToString()
        return text.encode()
    with tempfile.TemporaryDirectory() as folder:  # the binary form goes to files alone
        file = Path(folder) / "layer.usdc"
        layer.Export(str(file))
        return file.read_bytes()


def _stage(path: Path) -> Usd.Stage:
    try:
        return Usd.Stage.Open(str(path.resolve()))
    except Tf.ErrorException as error:
        lines = [" ".join(line.split()) for line in str(error).split("\n") if ": '" in line]
        finding = lines[0].partition(": '")[2].strip("'") if lines else type(error).__name__
        raise InputError(
            f"{path}: it cannot be read as USD ({finding[:160]}). Export it again."
        ) from error


@contextlib.contextmanager
def _listening(said: list[str]) -> Iterator[None]:
    """Within it the library's messages go into a list instead of stderr."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        said += [
            " ".join(message.commentary.split())[:200]
            for message in delegate.TakeUncoalescedDiagnostics()
        ]
        del delegate


@dataclass(eq=False)
class _Walk:
    """Everything that can be seen on a stage, found on the way through its prims."""

    path: Path
    stage: Usd.Stage
    found: list[MeshPrim] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    passed_over: list[str] = field(default_factory=list)
    placed: int = 0

    def __post_init__(self) -> None:
        self.time = Usd.TimeCode.EarliestTime()
        self.cache = UsdGeom.XformCache(self.time)
        self.children = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)

    def all(self) -> None:
        """Look at every prim once, those of instances once for each of them."""
        waiting: list[tuple[Usd.Prim, tuple[str, ...]]] = [(self.stage.GetPseudoRoot(), ())]
        while waiting:
            prim, instances = waiting.pop()
            below = self._below(prim, instances)
            if below is None:
                continue
            kind = str(prim.GetTypeName())
            self.counts[kind] = self.counts.get(kind, 0) + 1
            if prim.IsA(UsdGeom.PointInstancer):
                self._point_instancer(prim, below)
                continue
            if prim.IsA(UsdGeom.Mesh):
                world = self.cache.GetLocalToWorldTransform(prim)
                self._mesh(prim, below, (_columns(world),))
            waiting += [(c, below) for c in reversed(prim.GetFilteredChildren(self.children))]

    def _below(self, prim: Usd.Prim, instances: tuple[str, ...]) -> tuple[str, ...] | None:
        """The native instances that the prim's children stand in; None where nothing is to be seen."""
        seen = UsdGeom.Imageable(prim)
        if seen and seen.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible:
            return None
        return (*instances, str(prim.GetPath())) if prim.IsInstance() else instances

    def _mesh(
        self, prim: Usd.Prim, instances: tuple[str, ...], transforms: tuple[FloatArray, ...]
    ) -> None:
        if UsdGeom.Imageable(prim).ComputePurpose() not in SHOWN or not transforms:
            return
        self.placed += len(transforms)
        if self.placed > MOST_INSTANCES:
            raise InputError(f"{self.path}: more than {MOST_INSTANCES} instances cannot be baked.")
        mesh, time = UsdGeom.Mesh(prim), self.time
        points = _array(mesh.GetPointsAttr().Get(time), np.float64).reshape(-1, 3)
        sizes = _array(mesh.GetFaceVertexCountsAttr().Get(time), np.int64)
        corners = _array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64)
        self._check(prim, len(points), sizes, corners)
        normals, by_corner = self._normals(mesh, len(points), len(corners))
        primvars = _Primvars(mesh, time, len(points), sizes)
        solid, kept = without_holes(sizes, _array(mesh.GetHoleIndicesAttr().Get(time), np.int64))
        sizes, authored = sizes[solid], np.flatnonzero(kept)
        normals = normals[kept] if normals is not None and by_corner else normals
        if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
            authored = turned(sizes, authored)
        self.found.append(
            MeshPrim(
                binding=Binding(str(prim.GetPath()), instances),
                name=str(prim.GetName()),
                points=points,
                sizes=sizes,
                corners=corners[authored],
                normals=normals,
                by_corner=by_corner,
                subdivided=mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none,
                double_sided=bool(mesh.GetDoubleSidedAttr().Get(time)),
                transforms=transforms,
                authored=authored,
                solid=np.flatnonzero(solid),
                texture=primvars.texture(),
                colors=primvars.named("displayColor", 3),
                ao=primvars.named("ao", 1),
            )
        )

    def _check(self, prim: Usd.Prim, points: int, sizes: IndexArray, corners: IndexArray) -> None:
        where = f"{self.path}: mesh {prim.GetPath()}"
        if sizes.size and (sizes.min() < 0 or int(sizes.sum()) != len(corners)):
            raise InputError(
                f"{where}: its faces ask for {int(sizes.sum())} corners, and there are {len(corners)}. "
                "Export it again."
            )
        if corners.size and (corners.min() < 0 or int(corners.max()) >= points):
            bad = int(np.argmax((corners < 0) | (corners >= points)))
            raise InputError(
                f"{where}: corner {bad} points at vertex {int(corners[bad])}; there are {points}. "
                "Export it again."
            )

    def _normals(
        self, mesh: UsdGeom.Mesh, points: int, corners: int
    ) -> tuple[FloatArray | None, bool]:
        """Normals and whether they belong to corners; None where they fit neither corners nor points."""
        primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            found, kind = primvar.ComputeFlattened(self.time), primvar.GetInterpolation()
        else:
            found, kind = mesh.GetNormalsAttr().Get(self.time), mesh.GetNormalsInterpolation()
        normals = _array(found, np.float64).reshape(-1, 3)
        if kind == UsdGeom.Tokens.faceVarying and len(normals) == corners > 0:
            return normals, True
        if kind in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(normals) == points > 0:
            return normals, False
        return None, False

    def _point_instancer(self, prim: Usd.Prim, instances: tuple[str, ...]) -> None:
        """Every mesh of its prototypes, wherever they are put; a point instancer in one is passed over."""
        instancer = UsdGeom.PointInstancer(prim)
        chosen = _array(instancer.GetProtoIndicesAttr().Get(self.time), np.int64)
        local = instancer.ComputeInstanceTransformsAtTime(
            self.time,
            self.time,
            UsdGeom.PointInstancer.ExcludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        mask = _array(instancer.ComputeMaskAtTime(self.time), np.bool_)
        world = self.cache.GetLocalToWorldTransform(prim)
        if len(local) != len(chosen):
            raise InputError(
                f"{self.path}: point instancer {prim.GetPath()} has {len(chosen)} instances and places for "
                f"{len(local)}. Export it again."
            )
        for number, target in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            root = self.stage.GetPrimAtPath(target)
            shown = (chosen == number) & (mask if len(mask) == len(chosen) else True)
            if root and shown.any():
                at = [local[i] * world for i in np.flatnonzero(shown).tolist()]
                self._prototype(root, instances, at)

    def _prototype(self, root: Usd.Prim, instances: tuple[str, ...], at: list[object]) -> None:
        waiting = [(root, instances)]
        while waiting:
            prim, above = waiting.pop()
            below = self._below(prim, above)
            if below is None:
                continue
            if prim.IsA(UsdGeom.PointInstancer):
                self.passed_over.append(
                    f"point instancer {prim.GetPath()} stands in another one, and is passed over"
                )
                continue
            if prim.IsA(UsdGeom.Mesh):
                own, _ = self.cache.ComputeRelativeTransform(prim, root.GetParent())
                self._mesh(prim, below, tuple(_columns(own * place) for place in at))
            waiting += [(c, below) for c in prim.GetFilteredChildren(self.children)]


class _Primvars:
    """What a mesh has beside points and normals, as far as there are as many values as are needed."""

    def __init__(
        self, mesh: UsdGeom.Mesh, time: Usd.TimeCode, points: int, sizes: IndexArray
    ) -> None:
        self.found = UsdGeom.PrimvarsAPI(mesh)
        self.time = time
        tokens = UsdGeom.Tokens
        self.needed = {
            tokens.constant: 1,
            tokens.uniform: len(sizes),
            tokens.vertex: points,
            tokens.varying: points,
            tokens.faceVarying: int(sizes.sum()),
        }

    def texture(self) -> Values | None:
        """`st`, by custom; else the first primvar by name that is a texture coordinate."""
        others = [
            primvar.GetPrimvarName()
            for primvar in self.found.GetPrimvarsWithValues()
            if primvar.GetTypeName().role == "TextureCoordinate"
        ]
        return next(
            (found for name in ("st", *sorted(others)) if (found := self.named(name, 2))), None
        )

    def named(self, name: str, width: int) -> Values | None:
        """The values of a primvar, which have this many numbers each; an inherited one counts as well."""
        primvar = self.found.FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return None
        interpolation = primvar.GetInterpolation()
        flat = primvar.ComputeFlattened(self.time)
        try:
            values = _array(flat, np.float64)
        except (TypeError, ValueError):  # a primvar of this name may be text
            return None
        values = values[:, None] if values.ndim == width == 1 else values
        if values.shape != (self.needed.get(interpolation), width):
            return None
        return Values(values, str(interpolation))


def _colors(prim: Usd.Prim) -> Colors | None:
    time = Usd.TimeCode.EarliestTime()
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
    if not primvar or not primvar.HasValue():
        return None
    mesh = UsdGeom.Mesh(prim)
    return Colors(
        values=_array(primvar.ComputeFlattened(time), np.float64).reshape(-1, 3),
        interpolation=str(primvar.GetInterpolation()),
        sizes=_array(mesh.GetFaceVertexCountsAttr().Get(time), np.int64),
        corners=_array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64),
    )


def _array(values: object, dtype: type[ScalarT]) -> NDArray[ScalarT]:
    """An array of the library, or None, as a copy of its numbers."""
    return np.array([] if values is None else values, dtype)


def _columns(matrix: object) -> FloatArray:
    """(4, 4) for column vectors; the library's are for rows."""
    return np.array(matrix, np.float64).T

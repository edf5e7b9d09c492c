"""USD files with a skinned, animated skeleton (UsdSkel)."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.extras import require
from physique.reference import reduced
from physique.render import palette
from physique.render.layout import side_by_side
from physique.render.sampling import common_timestep
from physique.render.surface import Surface, surface
from physique.runs.run import Run
from physique.store import PathLike, write_atomic

Array = NDArray[np.float64]


def write_usd(path: PathLike, runs: Sequence[Run], *, source: bool = False, capsules: bool = False) -> Path:
    """Write runs side by side as UsdSkel figures, in metres, z up, a time code a frame.

    path: ends in .usd or .usdc (binary) or .usda (text). source: adds the source motion of each
    run, pale, where it was recorded. capsules: the simulator's shapes in place of the skin.
    Several runs are moved apart along y; one stays where it is. Raises InputError where usd-core is
    missing, a run has no skin, runs have different time steps, or the file cannot be written.
    """
    path = Path(path)
    Usd, UsdGeom = require("pxr.Usd", "usd"), require("pxr.UsdGeom", "usd")
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    rate = 1.0 / common_timestep(runs)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(max(run.trajectory.frames for run in runs) - 1)
    for index, (run, shift) in enumerate(zip(runs, side_by_side(runs))):
        shown = surface(run, capsules=capsules, colour=palette.body(index))
        motions = [("simulated", run.trajectory.q, shown, 1.0)]
        if source:
            pale = shown.in_colour(palette.SOURCE)
            motions.append(("source", run.trajectory.source_q, pale, palette.SOURCE_OPACITY))
        for kind, q, look, opacity in motions:
            name = f"/World/run{index}_{kind}"
            _add_figure(stage, name, look, q, shift, opacity, f"{run.name}, {kind}")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"stage{path.suffix.lower()}"
        stage.GetRootLayer().Export(str(copy))
        write_atomic(path, copy.read_bytes())
    return path


def _add_figure(
    stage: Any, name: str, shown: Surface, q: Array, shift: Array, opacity: float, label: str
) -> None:
    """One skinned, animated person under the prim `name`, moved by `shift` (3,) m."""
    Gf, Vt, UsdGeom, UsdSkel = (
        require(f"pxr.{module}", "usd") for module in ("Gf", "Vt", "UsdGeom", "UsdSkel")
    )
    root = UsdSkel.Root.Define(stage, name)
    root.GetPrim().SetDisplayName(label)
    root.AddTranslateOp().Set(Gf.Vec3d(*map(float, shift)))
    paths = joint_paths()

    bones = UsdSkel.Skeleton.Define(stage, f"{name}/skeleton")
    bones.CreateJointsAttr(paths)
    offsets = shown.joints - shown.joints[np.maximum(skeleton.PARENTS, 0)]
    offsets[0] = shown.joints[0]
    bones.CreateBindTransformsAttr(_translations(shown.joints))
    bones.CreateRestTransformsAttr(_translations(offsets))

    animation = UsdSkel.Animation.Define(stage, f"{name}/skeleton/animation")
    animation.CreateJointsAttr(paths)
    animation.CreateScalesAttr([Gf.Vec3h(1.0, 1.0, 1.0)] * len(paths))
    turns = rotations.continuous(rotations.normalize(reduced.to_rotations(q[:, 3:7], q[:, 7:])))
    moved = np.tile(offsets.astype(np.float32), (len(q), 1, 1))
    moved[:, 0] = q[:, :3]
    translation, rotation = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    # Gf counts quaternions' real part last in memory.
    turns = np.ascontiguousarray(turns[..., [1, 2, 3, 0]], dtype=np.float32)
    for t in range(len(q)):
        translation.Set(Vt.Vec3fArray.FromNumpy(moved[t]), t)
        rotation.Set(Vt.QuatfArray.FromNumpy(turns[t]), t)
    UsdSkel.BindingAPI.Apply(bones.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])

    mesh = UsdGeom.Mesh.Define(stage, f"{name}/surface")
    points = np.ascontiguousarray(shown.vertices, dtype=np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(shown.faces), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(
        Vt.IntArray.FromNumpy(np.ascontiguousarray(shown.faces.ravel(), dtype=np.int32))
    )
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr([Gf.Vec3f(*map(float, x)) for x in (points.min(0), points.max(0))])
    mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(
        Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(shown.colours, dtype=np.float32))
    )
    mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([opacity])
    skin = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    skin.CreateSkeletonRel().SetTargets([bones.GetPath()])
    skin.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    owners, weights = strongest(shown.weights)
    count = owners.shape[1]
    skin.CreateJointIndicesPrimvar(False, count).Set(Vt.IntArray.FromNumpy(owners.ravel()))
    skin.CreateJointWeightsPrimvar(False, count).Set(Vt.FloatArray.FromNumpy(weights.ravel()))


def joint_paths() -> list[str]:
    """The joints as USD names them: each with its parents before it."""
    paths: list[str] = []
    for joint, parent in zip(skeleton.JOINTS, skeleton.PARENTS):
        paths.append(joint if parent < 0 else f"{paths[parent]}/{joint}")
    return paths


def strongest(weights: Array) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Joints and weights (V, K) of skin weights (V, 22), with K as many as any vertex has."""
    count = int((weights > 0).sum(axis=1).max())
    owners = np.argsort(-weights, axis=1, kind="stable")[:, :count]
    return owners.astype(np.int32), np.take_along_axis(weights, owners, 1).astype(np.float32)


def _translations(places: Array) -> Any:
    Gf, Vt = require("pxr.Gf", "usd"), require("pxr.Vt", "usd")
    return Vt.Matrix4dArray([Gf.Matrix4d(1.0).SetTranslate(Gf.Vec3d(*map(float, p))) for p in places])

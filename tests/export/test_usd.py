"""USD files: usd-core's own skinning gives the points of ours."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from physique.errors import InputError
from physique.export.usd import write_usd
from physique.render.layout import side_by_side
from physique.render.skin import skin_vertices
from physique.render.surface import capsule_surface, surface
from physique.runs.run import Run

pytest.importorskip("pxr", reason="needs usd-core: pip install 'physique[usd]'")
from pxr import Gf, Usd, UsdGeom, UsdSkel


def skinned(stage: Usd.Stage, figure: str, frame: int) -> np.ndarray:
    """World positions (V, 3) of a figure's points, by UsdSkel."""
    root = UsdSkel.Root(stage.GetPrimAtPath(figure))
    cache = UsdSkel.Cache()
    assert cache.Populate(root, Usd.PrimDefaultPredicate)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"{figure}/surface"))
    bones = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath(f"{figure}/skeleton")))
    joints = bones.ComputeSkinningTransforms(frame)
    points = mesh.GetPointsAttr().Get()
    query = cache.GetSkinningQuery(mesh.GetPrim())
    assert query.ComputeSkinnedPoints(joints, points, frame)
    place = UsdGeom.XformCache(frame).GetLocalToWorldTransform(root.GetPrim())
    return np.array([place.Transform(Gf.Vec3d(p)) for p in points])


def test_skinned_points_are_ours_to_a_tenth_of_a_millimetre(run: Run, tmp_path: Path) -> None:
    path = write_usd(tmp_path / "walk.usd", [run])
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert stage.GetTimeCodesPerSecond() == 100.0
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, run.trajectory.frames - 1)
    assert run.mesh is not None
    for frame in (0, 17, 50):
        wanted = skin_vertices(run.mesh, run.trajectory.q[frame : frame + 1])[0]
        found = skinned(stage, "/World/run0_simulated", frame)
        assert np.abs(found - wanted).max() < 1e-4


def test_a_stick_follows_the_wrist_in_either_look(armed_run: Run, tmp_path: Path) -> None:
    q = armed_run.trajectory.q[33:34]
    for capsules in (False, True):
        path = write_usd(tmp_path / "a.usd", [armed_run], capsules=capsules)
        shown = surface(armed_run, capsules=capsules)
        found = skinned(Usd.Stage.Open(str(path)), "/World/run0_simulated", 33)
        assert len(found) == len(shown.vertices)
        assert np.abs(found - skin_vertices(shown, q)[0]).max() < 1e-4


def test_other_runs_stand_beside_and_the_source_in_place(run: Run, tmp_path: Path) -> None:
    path = write_usd(tmp_path / "two.usda", [run, run], source=True, capsules=True)
    assert path.read_text().startswith("#usda")
    stage = Usd.Stage.Open(str(path))
    figures = [prim.GetName() for prim in stage.GetDefaultPrim().GetChildren()]
    assert figures == ["run0_simulated", "run0_source", "run1_simulated", "run1_source"]
    shapes = capsule_surface(run.body)
    shifts = np.repeat(side_by_side([run, run]), 2, axis=0)
    for name, q, shift in zip(figures, [run.trajectory.q, run.trajectory.source_q] * 2, shifts):
        wanted = skin_vertices(shapes, q[20:21])[0] + shift
        assert np.abs(skinned(stage, f"/World/{name}", 20) - wanted).max() < 1e-4


def test_between_frames_joints_do_not_spin(run: Run, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(write_usd(tmp_path / "walk.usdc", [run])))
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/World/run0_simulated/skeleton/animation"))
    attribute = animation.GetRotationsAttr()
    turns = [
        np.array([[q.GetReal(), *q.GetImaginary()] for q in attribute.Get(t)])
        for t in range(run.trajectory.frames)
    ]
    assert min((a * b).sum(1).min() for a, b in pairwise(turns)) > 0.9


def test_a_run_without_a_skin_needs_capsules(run: Run, tmp_path: Path) -> None:
    bare = replace(run, mesh=None)
    with pytest.raises(InputError, match="add --capsules"):
        write_usd(tmp_path / "a.usd", [bare])
    assert list(tmp_path.iterdir()) == []
    assert write_usd(tmp_path / "a.usd", [bare], capsules=True).is_file()


def test_a_missing_package_is_asked_for_in_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "pxr"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(InputError, match=r"pip install 'physique\[usd\]'"):
        write_usd(tmp_path / "a.usd", [run])
    assert list(tmp_path.iterdir()) == []

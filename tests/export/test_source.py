"""The source is shown where it was recorded: it never jumps where errors are measured anew."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from test_gltf import Reader

from physique.commands.export import export_run
from physique.export.bvh import R_FILE_FROM_WORLD
from physique.export.formats import FORMATS, find_format
from physique.render.layout import side_by_side
from physique.render.scene import stage_runs
from physique.runs.run import Run
from stepped_runs import BORDER, STEP, stepped

Array = NDArray[np.float64]


def of_glb(path: Path) -> Array:
    file = Reader(path.read_bytes())
    moves = [c for c in file.json["animations"][0]["channels"] if c["target"]["path"] == "translation"]
    source = file.json["animations"][0]["samplers"][moves[1]["sampler"]]
    return np.asarray(file.values(source["output"]) @ R_FILE_FROM_WORLD)


def of_bvh(path: Path) -> Array:
    rows = path.read_text().split("Frame Time:")[1].splitlines()[1:]
    return np.array([[float(x) for x in row.split()[:3]] for row in rows]) / 100 @ R_FILE_FROM_WORLD


def of_usd(path: Path) -> Array:
    pytest.importorskip("pxr", reason="needs usd-core: pip install 'physique[usd]'")
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(path))
    moves = UsdSkel.Animation(stage.GetPrimAtPath("/World/run0_source/skeleton/animation"))
    places = moves.GetTranslationsAttr()
    return np.array([places.Get(t)[0] for t in range(int(stage.GetEndTimeCode()) + 1)], dtype=float)


def of_amass(path: Path) -> Array:
    with np.load(path) as data:
        return np.asarray(data["trans"])


def of_mjcf(path: Path) -> Array:
    model = mujoco.MjModel.from_xml_path(str(path))
    # No key is thrown by the border either.
    assert np.abs(model.key_qvel[:, :2]).max() < 3.0
    return np.array(model.key_qpos[:, :3])


def of_csv(path: Path) -> Array:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    moved = np.array([[float(row[f"source_moved_{axis}_m"]) for axis in "xy"] for row in rows])
    assert moved[[BORDER, BORDER + 1]] == pytest.approx(np.array([0 * STEP, STEP]))
    return np.array([[float(row[f"source_pelvis_{axis}_m"]) for axis in "xyz"] for row in rows])


READERS: dict[str, Callable[[Path], Array]] = {
    "glb": of_glb,
    "bvh": of_bvh,
    "usd": of_usd,
    "amass": of_amass,
    "mjcf": of_mjcf,
    "csv": of_csv,
}


@pytest.mark.parametrize("name", READERS)
def test_the_source_stays_where_it_was_recorded(run: Run, tmp_path: Path, name: str) -> None:
    out = tmp_path / f"a{find_format(name, tmp_path).suffixes[0]}"
    rate = 100.0 if name == "mjcf" else None
    (path,) = export_run(stepped(run), name, out, source=True, rate=rate)
    found = READERS[name](path)
    assert found == pytest.approx(run.trajectory.reference_q[:, :3], abs=1e-5)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert steps.max() < np.linalg.norm(STEP) / 2


def test_no_format_is_left_out() -> None:
    assert {*READERS, "mp4"} == {kind.name for kind in FORMATS}


def test_the_ghost_of_a_scene_does_not_jump(run: Run) -> None:
    scene, unmoved = (stage_runs([r], source=True, capsules=True) for r in (stepped(run), run))
    track, steady = (s.actors[0].joints(s.frames)[:, 0] for s in (scene, unmoved))
    assert np.diff(track, axis=0) == pytest.approx(np.diff(steady, axis=0), abs=1e-9)


@pytest.mark.parametrize("way", [(1.5, 0.0), (0.0, 1.5), (0.0, -1.5)])
def test_a_body_that_drifts_away_and_its_ghost_are_both_in_the_picture(
    run: Run, way: tuple[float, float]
) -> None:
    size = (200, 150)
    q = run.trajectory.q.copy()
    q[:, :2] += np.linspace(0.0, 1.0, len(q))[:, None] * way
    drifting = replace(run, trajectory=replace(run.trajectory, q=q))
    scene = stage_runs([drifting], size, source=True, capsules=True)
    for frame in (0, 13, 37, scene.frames - 1):
        camera = scene.camera.follow(scene.route[frame])
        for actor in scene.actors:
            pixels = camera.project(actor.vertices(frame), size)
            assert pixels.min() > 0
            assert (pixels.max(axis=0) < size).all()


def test_runs_beside_each_other_leave_room_for_their_sources(run: Run) -> None:
    """It is the sources as they are shown that need room."""
    assert side_by_side([stepped(run)] * 2) == pytest.approx(side_by_side([run] * 2))

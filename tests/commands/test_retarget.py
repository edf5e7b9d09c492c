"""The whole flow: what a run leaves is real physics, and the same however it was computed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest

import physique
from physique import rotations, skeleton
from physique.body.capsule_body import CapsuleBody
from physique.character.hinges import columns
from physique.character.kinematics import poses
from physique.character.model import empty_handed
from physique.commands.inputs import find_body
from physique.errors import InputError
from physique.motion.clip import Motion
from physique.runs.run import NAMES, Run
from physique.tracking import ddp

HELD = physique.Held("stick", 5.0, 1.0)
START, END = 0.5, 0.75  # s of the walk: two windows at a horizon of 0.2 s


@pytest.fixture(scope="session")
def body() -> CapsuleBody:
    return find_body("average")[1]


def walk(body: CapsuleBody, **options: object) -> Run:
    options = {"start": START, "end": END, "horizon": 0.2, "threads": 1, **options}
    return physique.retarget("walk", body, **options)  # type: ignore[arg-type]


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few iterations, where the quality of the result does not matter."""
    monkeypatch.setattr(ddp, "DdpOptions", partial(ddp.DdpOptions, iterations=4))


@pytest.fixture(scope="session")
def run(body: CapsuleBody, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return walk(body, out=tmp_path_factory.mktemp("run") / "new" / "folder")


def same_motion(a: Run, b: Run) -> bool:
    pairs = zip(vars(a.trajectory).items(), vars(b.trajectory).items(), strict=True)
    return all(name == other and np.array_equal(x, y) for (name, x), (other, y) in pairs)


def without_clock(metrics: dict[str, object]) -> str:
    """Metrics as JSON but for wall time, which no two computations share."""

    def strip(value: object) -> object:
        if isinstance(value, dict):
            return {k: strip(v) for k, v in value.items() if not k.startswith("wall_s")}
        return [strip(v) for v in value] if isinstance(value, list) else value

    return json.dumps(strip(metrics), sort_keys=True)


def test_plain_mujoco_replays_the_run(run: Run) -> None:
    assert run.folder is not None
    model = mujoco.MjModel.from_xml_path(str(run.folder / "character.xml"))
    data = mujoco.MjData(model)
    with np.load(run.folder / "trajectory.npz") as stored:
        q, v, control, torque = (stored[name] for name in ("q", "v", "control", "torque"))
    assert model.opt.gravity[2] == pytest.approx(-9.81)
    data.qpos[:], data.qvel[:] = q[0], v[0]
    for t, targets in enumerate(control):
        data.ctrl[:] = targets
        mujoco.mj_step(model, data)
        np.testing.assert_allclose(data.qpos, q[t + 1], rtol=0, atol=1e-6)
        np.testing.assert_allclose(data.qvel, v[t + 1], rtol=0, atol=1e-6)
        np.testing.assert_allclose(data.actuator_force, torque[t], rtol=0, atol=1e-6)


def test_no_force_acts_but_joints_gravity_and_contact(run: Run) -> None:
    model = mujoco.MjModel.from_xml_string(run.character_xml)
    # Actuators on hinges only: none can push the free joint of the pelvis.
    kinds = model.jnt_type[model.actuator_trnid[:, 0]]
    assert model.nu == 50
    assert np.all(kinds == mujoco.mjtJoint.mjJNT_HINGE)
    assert np.all(model.body_gravcomp == 0)
    assert model.neq == model.ntendon == model.nmocap == 0
    assert np.all(model.jnt_stiffness == 0)


def test_the_body_follows_and_the_shapes_are_as_documented(run: Run) -> None:
    motion = run.trajectory
    frames = round(run.metrics["reference_seconds"] * 100) + 1
    assert frames / 100 == pytest.approx(END - START, abs=0.02)
    shapes = {name: array.shape for name, array in vars(motion).items()}
    assert shapes == {
        "times": (frames,),
        "q": (frames, 57),
        "v": (frames, 56),
        "control": (frames - 1, 50),
        "torque": (frames - 1, 50),
        "reference_q": (frames, 57),
        "shift": (frames, 2),
    }
    assert run.success
    assert run.metrics["mpjpe_mm"] < 60
    assert run.metrics["sim_steps"] == sum(w["sim_steps"] for w in run.metrics["windows"]) > 0
    ends = [(round(w["start"], 6), round(w["end"], 6)) for w in run.metrics["windows"]]
    assert len(ends) == 2
    assert [end for _, end in ends[:-1]] == [start for start, _ in ends[1:]]
    assert (ends[0][0], ends[-1][1]) == (0, round((frames - 1) / 100, 6))


def test_the_folder_holds_the_run_and_nothing_else(run: Run) -> None:
    assert run.folder is not None
    visible = [p.name for p in run.folder.iterdir() if not p.name.startswith(".")]
    assert sorted(visible) == sorted(set(NAMES) - {"windows", "policy.npz", "tree.json", "tree"})
    loaded = physique.load_run(run.folder)
    assert same_motion(loaded, run)
    assert loaded.metrics == json.loads(json.dumps(run.metrics))
    assert loaded.character_xml == run.character_xml
    again = physique.read_motion(run.folder / "motion.bvh", low_pass=None)
    assert again.frames == run.trajectory.frames
    assert again.fps == pytest.approx(100)


def test_two_threads_give_the_same_bits(run: Run, body: CapsuleBody) -> None:
    other = walk(body, threads=2)
    assert same_motion(other, run)
    assert without_clock(other.metrics) == without_clock(run.metrics)


def test_a_killed_run_resumes_to_the_same_bits(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "killed"
    command = [
        sys.executable,
        "-m",
        "physique",
        "retarget",
        "walk",
        "--body",
        "average",
        "--start",
        str(START),
        "--end",
        str(END),
        "--horizon",
        "0.2",
        "--threads",
        "1",
        "--out",
        str(folder),
    ]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    while not (folder / "windows" / "0000.npz").exists():
        assert process.poll() is None, "the run ended before it was killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (folder / "metrics.json").exists()
    assert json.loads((folder / "run.json").read_text())["status"] == "running"
    with pytest.raises(InputError, match="--resume"):
        physique.load_run(folder)
    done = subprocess.run([*command, "--resume"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    resumed = physique.load_run(folder)
    assert same_motion(resumed, run)
    assert without_clock(resumed.metrics) == without_clock(
        json.loads((Path(str(run.folder)) / "metrics.json").read_text())
    )
    assert not (folder / "windows").exists()


def test_a_finished_run_resumes_without_work(run: Run, body: CapsuleBody) -> None:
    told: list[object] = []
    again = walk(body, out=run.folder, resume=True, progress=told.append)
    assert same_motion(again, run)
    assert told == []


def test_a_run_is_not_replaced_by_accident(run: Run, body: CapsuleBody) -> None:
    with pytest.raises(InputError, match=r"a finished run.*--resume.*--overwrite"):
        walk(body, out=run.folder)
    with pytest.raises(InputError, match=r"run\.json: found a run with seed 0; expected 7"):
        walk(body, out=run.folder, resume=True, seed=7)
    with pytest.raises(InputError, match="a run with end"):
        walk(body, out=run.folder, resume=True, end=0.9)
    assert same_motion(physique.load_run(str(run.folder)), run)


def test_options_are_one_value_or_names(body: CapsuleBody, run: Run) -> None:
    options = physique.RetargetOptions(start=START, end=0.9, horizon=0.2)
    again = physique.retarget("walk", body, options, end=END, out=run.folder, resume=True)
    assert same_motion(again, run)
    with pytest.raises(TypeError, match="ends"):
        physique.retarget("walk", body, ends=0.6)


@pytest.mark.usefixtures("hasty")
def test_progress_reaches_the_end(body: CapsuleBody) -> None:
    told: list[physique.Progress] = []
    walk(body, torque_limit=120.0, progress=told.append)
    assert told[0].done == 0
    assert told[-1].done == pytest.approx(told[-1].total)
    assert told[-1].total > 0.2
    assert told[-1].error is not None
    assert max(step.iteration for step in told) > 0


@pytest.mark.usefixtures("hasty")
def test_a_body_too_weak_falls_and_says_so(body: CapsuleBody) -> None:
    weak = walk(body, start=0.0, end=1.0, torque_limit=1.0)
    assert not weak.success
    assert weak.metrics["mpjpe_max_mm"] > 500
    assert weak.metrics["torque_saturation"] > 0.3
    assert not all(w["success"] for w in weak.metrics["windows"])


@pytest.fixture(scope="session")
def loaded(body: CapsuleBody, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The walk with a stick of 5 kg in the right hand."""
    return walk(body, hold=HELD, out=tmp_path_factory.mktemp("loaded") / "run")


def test_a_held_object_is_in_the_run_and_in_its_model(loaded: Run, body: CapsuleBody) -> None:
    test_plain_mujoco_replays_the_run(loaded)
    test_no_force_acts_but_joints_gravity_and_contact(loaded)
    stored = physique.load_run(str(loaded.folder))
    model = stored.character().model
    assert [g.name for g in physique.held_geoms(model)] == ["held_right"]
    assert model.body_subtreemass[0] == pytest.approx(body.mass + 5.0, rel=1e-5)
    assert stored.metrics["held_mass_kg"] == 5.0
    assert stored.metrics["body_mass_kg"] == body.mass
    assert stored.record["identity"]["hold"] == "stick:5.0kg:1.0m"
    assert stored.record["identity"]["hand"] == "right"
    assert stored.name == "walk on average, stick of 5 kg (1 m) in the right hand"
    # The skeleton that is exported is the person's.
    assert physique.read_motion(Path(str(loaded.folder)) / "motion.bvh").frames > 0


def test_two_threads_give_the_same_bits_with_an_object(loaded: Run, body: CapsuleBody) -> None:
    assert same_motion(walk(body, hold=HELD, threads=2), loaded)


def test_another_object_or_weight_is_another_run(loaded: Run, body: CapsuleBody) -> None:
    again = partial(walk, body, out=loaded.folder, resume=True)
    assert same_motion(again(hold=HELD), loaded)
    with pytest.raises(InputError, match=r"hand right; expected None"):
        again()
    with pytest.raises(InputError, match=r"hold stick:5.0kg:1.0m; expected stick:4.0kg:1.0m"):
        again(hold=physique.Held("stick", 4.0, 1.0))
    with pytest.raises(InputError, match="hand right; expected left"):
        again(hold=physique.Held("stick", 5.0, 1.0, "left"))
    with pytest.raises(InputError, match=r"weight com 15\.0; expected 30\.0"):
        again(hold=HELD, weights=physique.Weights(com=30.0))
    with pytest.raises(InputError, match="joint weights"):
        again(hold=HELD, weights=physique.Weights(joints=np.ones(50)))


@pytest.mark.usefixtures("hasty")
def test_weights_weigh(body: CapsuleBody) -> None:
    """A weight a hundred times as great halves its term, as the plain weights measure it."""
    plain, rooted = walk(body), walk(body, weights=physique.Weights(root=400.0))
    assert rooted.metrics["cost"]["root"] / 100 < 0.5 * plain.metrics["cost"]["root"]


def test_the_mass_of_what_is_held_changes_the_motion(body: CapsuleBody) -> None:
    """Standing with an arm held out: the trunk leans away, and shoulder and trunk work more."""
    frames = 51
    turns = np.tile(rotations.IDENTITY, (frames, 22, 1))
    stand = Motion(
        "stand",
        "T-pose",
        100.0,
        turns,
        np.tile(body.joints[0], (frames, 1)),
        body.joints,
        np.ones((frames, 2), dtype=bool),
    )
    found = []
    for mass in (None, 2.0, 8.0):
        hold = None if mass is None else physique.Held("stick", mass, 1.0)
        run = physique.retarget(stand, body, hold=hold, threads=1)
        assert run.success
        pose = poses(empty_handed(run.character()), run.trajectory.q[25:])
        spine = pose.joints[:, skeleton.INDEX["neck"]] - pose.joints[:, 0]
        torque = np.abs(run.trajectory.torque[25:]).mean(axis=0)
        found.append(
            [
                float((spine[:, 1] / spine[:, 2]).mean()),  # to the left
                float((pose.com - pose.joints[:, [7, 8]].mean(axis=1))[:, 1].mean()),
                float(torque[columns("right_shoulder")].sum()),
                float(torque[columns("spine1")].sum()),
            ]
        )
    assert np.all(np.diff(found, axis=0) > 0)
    lean, com, shoulder, _ = np.array(found).T
    assert np.degrees(lean[2] - lean[0]) > 3
    assert com[2] - com[0] > 0.02
    # Statics: 8 kg at the end of an arm of about 0.6 m.
    assert shoulder[2] - shoulder[0] == pytest.approx(8 * 9.81 * 0.6, rel=0.3)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"torque_limit": -3.0}, "torque limit: found -3 Nm"),
        ({"torque_limit": float("nan")}, "torque limit: found nan Nm"),
        ({"horizon": 0.0}, "horizon: found 0 s"),
        ({"horizon": float("nan")}, "horizon: found nan s"),
        ({"threads": 0}, "threads: found 0"),
        ({"seed": -1}, "seed: found -1"),
        ({"fps": float("inf")}, "fps: found inf"),
        ({"start": 3.0, "end": 1.0}, "start 3 s and end 1 s"),
        ({"start": 0.5, "end": 0.504}, "found .* frames"),
        ({"optimizer": "slow"}, "optimizer: found 'slow'"),
        ({"mapping": Path("no_such.toml")}, "no_such.toml"),
    ],
)
def test_bad_options_leave_no_trace(
    body: CapsuleBody, tmp_path: Path, options: dict[str, object], text: str
) -> None:
    with pytest.raises(InputError, match=text) as fault:
        walk(body, out=tmp_path / "out", **options)
    assert "\n" not in str(fault.value)
    assert not (tmp_path / "out").exists()

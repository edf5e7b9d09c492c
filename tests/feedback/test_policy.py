"""The policy file and what drives a character by it."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from physique.errors import InputError
from physique.feedback.policy import Policy, load_policy
from physique.feedback.tree import Branch, Tree, grown, read_policy, save_policy
from physique.runs.run import Run
from physique.simulation.closed_loop import Servo, motor_model
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.stepper import Push

ROOT = Path(__file__).resolve().parents[2]


def perform(policy: Policy, model: mujoco.MjModel) -> np.ndarray:
    """Every q of the motion under the policy, unpushed."""
    data = mujoco.MjData(model)
    policy.reset()
    data.qpos[:], data.qvel[:] = policy.initial_state
    found = [data.qpos.copy()]
    while policy.time < policy.seconds - 1e-9:
        data.ctrl[:] = policy.act(data.qpos, data.qvel)
        mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def fake_branch(tree: Tree, frame: int, nodes: int, seed: int) -> Branch:
    rng = np.random.default_rng(seed)
    part = slice(frame, frame + nodes)
    return Branch(
        q=tree.q[part],
        v=tree.v[part],
        control=tree.control[part],
        com=tree.com[part],
        com_velocity=tree.com_velocity[part],
        gains=tree.gains[part][::3],
        shift=rng.normal(size=2) * 0.01,
        parent=frame + nodes,
        frame=frame,
    )


@pytest.mark.parametrize("controller", ["pd", "lqr"])
def test_unpushed_it_repeats_the_motion(run: Run, folder: Path, controller: str) -> None:
    policy = load_policy(folder / "policy.npz", controller)
    q = perform(policy, run.character().model)
    np.testing.assert_allclose(q, run.trajectory.q, atol=1e-9)
    assert policy.time == pytest.approx(policy.seconds)


def test_torques_are_followed_on_motors(run: Run, folder: Path) -> None:
    policy = load_policy(folder / "policy.npz", control="torques")
    q = perform(policy, motor_model(run.character_xml))
    assert np.abs(q[:, :3] - run.trajectory.q[:, :3]).max() < 0.05


def test_without_contact_torques_do_what_targets_do(run: Run) -> None:
    servo = Servo(run.character_xml)
    model = motor_model(run.character_xml)
    rng = np.random.default_rng(0)
    q, v = run.trajectory.q[0].copy(), rng.normal(size=56)
    q[2] += 3.0
    targets = servo.within_limits(q[7:] + 0.5 * rng.normal(size=50), q, v)
    found = []
    for this, control in ((servo.model, targets), (model, servo.torques(targets, q, v))):
        data = mujoco.MjData(this)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, control
        mujoco.mj_step(this, data)
        found.append(data.qvel.copy())
    assert np.abs(found[0] - v).max() > 1.0
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)


def test_feedback_brings_the_body_to_rest(run: Run, folder: Path) -> None:
    model = run.character().model
    off = []
    for controller in ("pd", "lqr"):
        policy = load_policy(folder / "policy.npz", controller)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = policy.initial_state
        data.qvel[0] += 0.3
        while policy.time < policy.seconds - 1e-9:
            data.ctrl[:] = policy.act(data.qpos, data.qvel)
            mujoco.mj_step(model, data)
        away = data.qpos[:3] - run.trajectory.q[-1, :3]
        off.append([float(np.linalg.norm(x)) for x in (away, data.qvel[:3])])
    # By the motion's end it is half as far off, and much slower.
    assert off[1][0] < 0.7 * off[0][0] < 0.1
    assert off[1][1] < 0.5 * off[0][1]


def test_it_holds_the_last_frame(run: Run, folder: Path) -> None:
    policy = load_policy(folder / "policy.npz")
    policy.reset(policy.tree.frames - 1)
    last = run.trajectory
    for _ in range(3):
        targets = policy.act(last.q[-1], last.v[-1])
    np.testing.assert_allclose(targets, last.control[-1], atol=0.02)


def test_it_needs_numpy_and_mujoco_only(folder: Path) -> None:
    code = f"""
import sys
import importlib.abc

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.split(".")[0] in ("scipy", "numba", "cma", "rich", "tyro", "PIL", "threadpoolctl"):
            raise ImportError(name)

sys.meta_path.insert(0, Refuse())
sys.path.insert(0, {str(ROOT / "examples")!r})
from follow_policy import follow
assert follow({str(folder / "policy.npz")!r}, "targets", 50.0) < 0.1
assert follow({str(folder / "policy.npz")!r}, "torques", 50.0) < 0.1
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("steps", "first"), [(10, 11), (40, 21)])
def test_a_decision_waits_for_the_pushs_end_but_not_for_ever(
    run: Run, tree: Tree, steps: int, first: int
) -> None:
    policy = Policy(run.character_xml, tree, "tree", threads=1)
    policy.reset(2)
    decided: list[int] = []

    def control(t: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        before, targets = policy.decisions, policy.act(q, v)
        decided.extend([t] * (policy.decisions - before))
        return targets

    push = Push(9, (200.0, 0.0, 0.0), 0, steps)
    with MujocoSimulator(run.character(), 1) as simulator:
        simulator.perform(tree.q[2], tree.v[2], first + 1, control, push)
    assert decided == [first]


def test_the_file_gives_the_tree_again(tree: Tree, tmp_path: Path, folder: Path) -> None:
    whole = grown(tree, [fake_branch(tree, 5, 20, 0), fake_branch(tree, 12, 18, 1)])
    xml, _, _ = read_policy(folder / "policy.npz")
    save_policy(tmp_path / "policy.npz", xml, whole, {"clip": "standing"})
    again_xml, again, head = read_policy(tmp_path / "policy.npz")
    assert again_xml == xml
    assert head["clip"] == "standing"
    for name, value in vars(whole).items():
        assert np.array_equal(getattr(again, name), value), name
        assert getattr(again, name).dtype == value.dtype


def test_branches_lead_to_their_parents(tree: Tree) -> None:
    whole = grown(tree, [fake_branch(tree, 5, 20, 0)])
    node = tree.frames
    for step in range(20):
        assert whole.branch[node] == 0
        assert whole.frame[node] == 5 + step
        node = int(whole.parent[node])
    assert node == 25
    assert whole.branch[node] == -1
    assert whole.branches == 1
    assert whole.frames == tree.frames


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "foreign", "npz"])
def test_a_damaged_or_foreign_file_is_refused_in_a_line(folder: Path, tmp_path: Path, damage: str) -> None:
    data = (folder / "policy.npz").read_bytes()
    middle = len(data) // 2
    path = tmp_path / "policy.npz"
    path.write_bytes(
        {
            "cut": data[:middle],
            "flip": data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :],
            "empty": b"",
            "foreign": b"not a policy at all",
            "npz": (folder / "trajectory.npz").read_bytes(),
        }[damage]
    )
    with pytest.raises(InputError, match=r"policy\.npz: found") as fault:
        load_policy(path)
    assert "\n" not in str(fault.value)


def test_arrays_that_do_not_fit_are_refused(tree: Tree, folder: Path, tmp_path: Path) -> None:
    xml, _, _ = read_policy(folder / "policy.npz")
    for name, value in {
        "parent": tree.parent + 100_000,
        "gain": tree.gain[:-1],
        "q": np.full_like(tree.q, np.nan),
    }.items():
        save_policy(tmp_path / "p.npz", xml, replace(tree, **{name: value}), {})
        with pytest.raises(InputError, match="do not fit"):
            load_policy(tmp_path / "p.npz")


def test_a_tree_is_asked_for_only_where_one_is(folder: Path) -> None:
    with pytest.raises(InputError, match="without a tree"):
        load_policy(folder / "policy.npz", "tree")
    with pytest.raises(InputError, match="pd, lqr, tree"):
        load_policy(folder / "policy.npz", "mpc")


def test_a_tree_of_500_states_is_small_and_loads_fast(tree: Tree, folder: Path, tmp_path: Path) -> None:
    """By its size alone; 40 nodes a branch, as grown trees have on average."""
    xml, _, _ = read_policy(folder / "policy.npz")
    whole = grown(tree, [fake_branch(tree, i % 10, 40, i) for i in range(500)])
    path = tmp_path / "policy.npz"
    save_policy(path, xml, whole, {})
    assert path.stat().st_size < 250e6
    clock = time.process_time()
    load_policy(path)
    assert time.process_time() - clock < 2.0

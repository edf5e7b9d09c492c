"""Metrics against motions whose errors are known by construction."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from physique.character import kinematics
from physique.character.model import Character
from physique.character.soles import sole_points
from physique.character.state import finite_velocity
from physique.motion.read import read_motion
from physique.reference.reference import Reference, make_reference
from physique.reference.target import TERMS, Weights
from physique.runs import metrics
from physique.tracking import costs
from physique.tracking.trajectory import Trajectory, join
from physique.tracking.windows import Window


@pytest.fixture(scope="module")
def reference(character: Character) -> Reference:
    return make_reference(read_motion("walk", start=0.2, end=0.7), character)


def as_performed(reference: Reference, move: np.ndarray, shift: np.ndarray) -> Trajectory:
    """The reference itself, moved by move (3,) or (T, 3) m; the reference moved by shift (2,)."""
    frames = reference.frames
    q, wanted = reference.q.copy(), reference.q.copy()
    q[:, :3] += move
    wanted[:, :2] += shift
    return Trajectory(
        times=np.arange(frames) * reference.timestep,
        q=q,
        v=reference.v,
        control=q[1:, 7:],
        torque=np.zeros((frames - 1, 50)),
        reference_q=wanted,
        shift=wanted[:, :2] - reference.q[:, :2],
    )


def window(trajectory: Trajectory, start: int, stop: int, shift: np.ndarray) -> Window:
    return Window(
        start=start,
        stop=stop,
        q=trajectory.q[start : stop + 1],
        v=trajectory.v[start : stop + 1],
        control=trajectory.control[start:stop],
        torque=trajectory.torque[start:stop],
        shift=shift,
        tail_q=trajectory.q[:0],
        tail_v=trajectory.v[:0],
        tail_control=trajectory.control[:0],
        terms={"com": 1.0},
        cost=2.0,
        iterations=3,
        sim_steps=10,
        status="converged",
    )


def measure(character: Character, reference: Reference, trajectory: Trajectory) -> dict:  # type: ignore[type-arg]
    whole = window(trajectory, 0, trajectory.frames - 1, np.zeros(2))
    return metrics.measure(character, reference, trajectory, [whole], Weights())


def test_a_perfect_performance_has_no_error(character: Character, reference: Reference) -> None:
    m = measure(character, reference, as_performed(reference, np.zeros(3), np.zeros(2)))
    assert m["success"]
    for name in ("mpjpe_mm", "mpjpe_max_mm", "mpjpe_local_mm", "root_error_mm", "drift_mm"):
        assert m[name] == pytest.approx(0, abs=1e-9), name
    assert m["cost"]["total"] == pytest.approx(m["cost"]["acceleration"], abs=1e-12)
    assert m["foot_skate_mm_per_s"] == m["foot_skate_reference_mm_per_s"]


def test_a_moved_body_is_off_by_the_move(character: Character, reference: Reference) -> None:
    move = np.array([0.03, 0.04, 0.0])
    moved = as_performed(reference, move, np.zeros(2))
    m = measure(character, reference, moved)
    for name in ("mpjpe_mm", "mpjpe_max_mm", "root_error_mm", "mpjpe_unanchored_mm"):
        assert m[name] == pytest.approx(50.0), name
    assert m["mpjpe_local_mm"] == pytest.approx(0, abs=1e-9)
    # Eq. 3: weight 15 times the squared distance, at every frame.
    assert m["cost"]["com"] == pytest.approx(15 * 0.0025 * reference.frames)
    assert m["cost"]["total"] == pytest.approx(sum(m["cost"][t] for t in TERMS))
    assert m["cost_paper"] == m["cost"]
    heavier = metrics.measure(character, reference, moved, [], Weights(com=30.0))
    assert heavier["cost_paper"] == m["cost"]
    assert heavier["cost"]["com"] == pytest.approx(2.0 * m["cost"]["com"])


def test_moving_the_reference_along_is_told_apart(character: Character, reference: Reference) -> None:
    shift = np.array([0.3, -0.4])
    trajectory = as_performed(reference, np.array([*shift, 0.0]), shift)
    m = measure(character, reference, trajectory)
    assert m["mpjpe_mm"] == pytest.approx(0, abs=1e-9)
    assert m["mpjpe_unanchored_mm"] == pytest.approx(500.0)


def test_success_ends_at_half_a_metre(character: Character, reference: Reference) -> None:
    one_frame = np.zeros((reference.frames, 3))
    for height, success in ((0.499, True), (0.501, False)):
        one_frame[7, 2] = height
        m = measure(character, reference, as_performed(reference, one_frame, np.zeros(2)))
        assert m["success"] is success
        assert m["worst_frame"]["frame"] == 7
        assert m["worst_frame"]["time"] == pytest.approx(0.07)
        assert m["mpjpe_max_mm"] == pytest.approx(1e3 * height)
        assert m["windows"][0]["success"] is success


def test_a_motion_cut_short_is_no_success(character: Character, reference: Reference) -> None:
    whole = as_performed(reference, np.zeros(3), np.zeros(2))
    cut = whole.beginning(11)
    m = metrics.measure(character, reference, cut, [window(cut, 0, 10, np.zeros(2))], Weights())
    assert m["success"] is False
    assert m["mpjpe_mm"] == pytest.approx(0, abs=1e-9)


def test_no_window_at_all_still_gives_a_report(character: Character, reference: Reference) -> None:
    only = join(reference, reference.q[0], reference.v[0], [])
    m = metrics.measure(character, reference, only, [], Weights())
    assert (m["success"], m["frames"], m["windows"]) == (False, 1, [])
    assert all(np.isfinite(x) for x in m.values() if isinstance(x, float))


def test_penetration_is_depth_below_the_floor(character: Character, reference: Reference) -> None:
    lowest = kinematics.poses(character, reference.q).lowest.min(axis=1)
    sink = np.zeros((reference.frames, 3))
    sink[:, 2] = -lowest - 0.004  # every frame 4 mm deep
    sink[3, 2] -= 0.006
    m = measure(character, reference, as_performed(reference, sink, np.zeros(2)))
    assert m["penetration_max_mm"] == pytest.approx(10.0)
    assert m["penetration_mm"] == pytest.approx(4.0 + 6.0 / reference.frames)
    sink[:, 2] = -lowest + 0.001
    m = measure(character, reference, as_performed(reference, sink, np.zeros(2)))
    assert m["penetration_mm"] == m["penetration_max_mm"] == 0


def standing(character: Character, frames: int) -> np.ndarray:
    """The T-pose with the soles on the floor (T, 57)."""
    q = np.tile(character.model.qpos0, (frames, 1))
    q[:, :2] = 0.0
    q[:, 2] -= sole_points(character, q[:1])[..., 2].min()
    return q


def test_foot_skate_is_the_speed_of_sliding_feet(character: Character) -> None:
    q = standing(character, 30)
    assert metrics.foot_skate(character, q, 0.01) == 0
    q[:, 0] = 0.3 * 0.01 * np.arange(30)  # slides at 0.3 m/s
    assert metrics.foot_skate(character, q, 0.01) == pytest.approx(300)
    q[15:, 2] += 0.1  # then flies, faster
    q[15:, 0] += np.arange(15)
    assert metrics.foot_skate(character, q, 0.01) == pytest.approx(300)
    only_left = np.zeros((30, 2), dtype=bool)
    assert metrics.foot_skate(character, q, 0.01, only_left) == 0
    only_left[:, 0] = True
    assert metrics.foot_skate(character, q, 0.01, only_left) == pytest.approx(300)


def test_a_recording_skates_though_its_feet_hover(character: Character) -> None:
    q = standing(character, 30)
    q[:, 0] = 0.3 * 0.01 * np.arange(30)
    q[:, 2] += 0.05
    assert metrics.foot_skate(character, q, 0.01) == 0
    assert metrics.foot_skate(character, q, 0.01, own_floor=True) == pytest.approx(300)


def test_a_foot_that_turns_on_its_toes_does_not_slide(character: Character) -> None:
    # The whole body turns about the y axis through the frontmost lower edge of the toes.
    q = standing(character, 2)
    points = sole_points(character, q[:1])[0]
    low = points[points[..., 2] < 0.005]
    edge = np.array([low[:, 0].max(), 0.0, 0.0])
    angle = 0.3
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for t in range(2):
        q[t, :3] = edge + (turn if t else np.eye(3)) @ (q[t, :3] - edge)
    q[1, 3:7] = [np.cos(angle / 2), 0, np.sin(angle / 2), 0]
    assert metrics.foot_skate(character, q, 0.01) == pytest.approx(0, abs=50)
    assert metrics.foot_skate(
        character, q[[0, 0]] + [0.01, *[0] * 56] * np.arange(2)[:, None], 0.01
    ) == pytest.approx(1000)


def test_soles_are_where_the_simulator_has_the_feet(character: Character, reference: Reference) -> None:
    poses = kinematics.poses(character, reference.q)
    points = sole_points(character, reference.q)
    for side, geoms in enumerate(character.foot_geoms):
        lowest = poses.lowest[:, geoms].min(axis=1)
        np.testing.assert_allclose(points[:, side, :, 2].min(axis=1), lowest, atol=1e-12)


def test_saturation_counts_torques_at_their_limit(character: Character) -> None:
    torque = np.full((10, 50), 50.0)
    torque[:5, 2] = 100.0
    torque[:, 7] = -100.0
    torque[0, 8] = 99.0
    use = metrics.torque_use(character, torque)
    assert use["torque_saturation"] == pytest.approx(15 / 500)
    assert sorted(use["torque_saturation_by_joint"].values()) == [0.5, 1.0]
    assert use["torque_peak_nm"] == 100.0


def test_windows_have_their_own_errors(character: Character, reference: Reference) -> None:
    move = np.zeros((reference.frames, 3))
    move[21:, 2] = 0.02
    trajectory = as_performed(reference, move, np.zeros(2))
    windows = [
        window(trajectory, 0, 20, np.zeros(2)),
        window(trajectory, 20, trajectory.frames - 1, np.zeros(2)),
    ]
    first, second = metrics.measure(character, reference, trajectory, windows, Weights())["windows"]
    assert first["mpjpe_mm"] == pytest.approx(0, abs=1e-9)
    assert second["mpjpe_mm"] == pytest.approx(20.0)
    assert (first["start"], first["end"]) == (0.0, pytest.approx(0.2))
    assert first["difficulty"] == pytest.approx(2.0 / 0.2)


def test_join_moves_the_reference_as_each_window_did(reference: Reference) -> None:
    trajectory = as_performed(reference, np.zeros(3), np.zeros(2))
    shifts = (np.array([0.1, 0.0]), np.array([0.0, 0.2]))
    windows = [window(trajectory, 0, 20, shifts[0]), window(trajectory, 20, 40, shifts[1])]
    joined = join(reference, trajectory.q[0], trajectory.v[0], windows)
    moved = joined.reference_q[:, :2] - reference.q[:41, :2]
    np.testing.assert_allclose(moved[:21], np.tile(shifts[0], (21, 1)), atol=1e-12)
    np.testing.assert_allclose(moved[21:], np.tile(shifts[1], (20, 1)), atol=1e-12)
    np.testing.assert_array_equal(joined.q, trajectory.q[:41])
    np.testing.assert_array_equal(joined.control, trajectory.control[:40])


def test_motion_cost_agrees_with_the_problem_of_one_window(
    character: Character, reference: Reference
) -> None:
    random = np.random.default_rng(5)
    q = reference.q.copy()
    q[:, 7:] += 0.05 * random.normal(size=q[:, 7:].shape)
    v = finite_velocity(q, reference.timestep)
    plain = as_performed(reference, np.zeros(3), np.zeros(2))
    trajectory = dataclasses.replace(plain, q=q, v=v)
    pose = kinematics.poses(character, q)
    expected = costs.evaluate(
        Weights(),
        reference.target(0, reference.frames, np.zeros(2)),
        q,
        v,
        pose.com,
        kinematics.com_velocity(pose.com_jacobian, v),
        reference.timestep,
    )
    found = metrics.motion_cost(kinematics.poses(character, trajectory.q), reference, trajectory, Weights())
    assert found == pytest.approx(expected)
    assert costs.total(found) > 0.1

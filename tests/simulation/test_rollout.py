"""Many roll-outs are the single one, bit for bit, on any number of threads."""

from __future__ import annotations

import numpy as np
import pytest

from physique.character.kinematics import com_velocity, poses
from physique.character.model import Character
from physique.character.servo import pd_torque, within_limits
from physique.reference.reference import Reference
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.rollout import Rollout, simulate
from physique.simulation.stepper import Stepper

STEPS = 40


@pytest.fixture(scope="module")
def controls(walk: Reference) -> np.ndarray:
    rng = np.random.default_rng(5)
    return walk.q[21 : 21 + STEPS, 7:] + 0.05 * rng.normal(size=(6, STEPS, 50))


@pytest.fixture(scope="module")
def singles(character: Character, walk: Reference, controls: np.ndarray) -> list[Rollout]:
    stepper = Stepper(character.model)
    return [simulate(stepper, walk.q[20], walk.v[20], STEPS, lambda t, q, v, u=u: u[t])[0] for u in controls]


@pytest.mark.parametrize("threads", [1, 2])
def test_many_are_the_single_one(
    character: Character, walk: Reference, controls: np.ndarray, singles: list[Rollout], threads: int
) -> None:
    with MujocoSimulator(character, threads) as simulator:
        many = simulator.run_open_loop(walk.q[20], walk.v[20], controls)
        again = simulator.run(walk.q[20], walk.v[20], STEPS, [lambda t, q, v, u=u: u[t] for u in controls])
        assert simulator.steps == len(controls) * (2 * STEPS + 1)
    for i, single in enumerate(singles):
        expected = (single.q, single.v, single.com, single.com_velocity)
        for got, wanted in zip(many[:4], expected):
            assert np.array_equal(got[i], wanted)
        assert np.array_equal(again[i].q, single.q)
        assert np.array_equal(again[i].torque, single.torque)
        assert not many[4][i]
        assert not single.diverged
    # Different controls, different motions.
    assert np.abs(singles[0].q[-1] - singles[1].q[-1]).max() > 1e-3


def test_any_frame_can_be_resumed(character: Character, singles: list[Rollout]) -> None:
    whole = singles[0]
    stepper = Stepper(character.model)
    rest, _ = simulate(stepper, whole.q[15], whole.v[15], STEPS - 15, lambda t, q, v: whole.control[15 + t])
    assert np.array_equal(rest.q, whole.q[15:])
    assert np.array_equal(rest.v, whole.v[15:])


def test_sensors_are_the_centre_of_mass_of_their_own_frame(
    character: Character, singles: list[Rollout]
) -> None:
    pose = poses(character, singles[0].q)
    np.testing.assert_allclose(singles[0].com, pose.com, atol=1e-12)
    np.testing.assert_allclose(
        singles[0].com_velocity, com_velocity(pose.com_jacobian, singles[0].v), atol=1e-11
    )


def test_torque_is_the_papers_pd_controller(character: Character, singles: list[Rollout]) -> None:
    for r in singles:
        by_hand = np.clip(700.0 * (r.control - r.q[:-1, 7:]) - 1.0 * r.v[:-1, 6:], -100.0, 100.0)
        np.testing.assert_allclose(r.torque, by_hand, atol=1e-9)
        np.testing.assert_allclose(pd_torque(character, r.control, r.q[:-1], r.v[:-1]), by_hand)
    assert max(np.abs(r.torque).max() for r in singles) == 100.0  # the limit was met


def test_within_limits_keeps_the_torque(character: Character) -> None:
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(20, 57)), 5 * rng.normal(size=(20, 56))
    control = q[:, 7:] + rng.normal(size=(20, 50))
    moved = within_limits(character, control, q, v)
    before, after = pd_torque(character, control, q, v), pd_torque(character, moved, q, v)
    np.testing.assert_allclose(after, before, rtol=2e-6)
    assert np.all(np.abs(after) < 100.0)
    inside = np.abs(before) < 99.0
    assert inside.any()
    assert not inside.all()
    np.testing.assert_allclose(moved[inside], control[inside], atol=1e-12)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_blow_up_is_noticed(character: Character, walk: Reference) -> None:
    control = np.tile(walk.q[20, 7:], (3, STEPS, 1))
    v = walk.v[20].copy()
    calm = v.copy()
    v[6:] = 1e9
    with MujocoSimulator(character, 2) as simulator:
        blown = simulator.run_open_loop(walk.q[20], v, control)
        fine = simulator.run_open_loop(walk.q[20], calm, control)
        single = simulator.run(walk.q[20], v, STEPS, [lambda t, q, v: control[0, t]])[0]
    assert blown[4].all()
    assert not fine[4].any()
    assert single.diverged


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_blow_up_leaves_the_others_alone(character: Character, walk: Reference) -> None:
    good = walk.q[21 : 21 + STEPS, 7:]
    bad = good.copy()
    bad[3] = np.nan
    with MujocoSimulator(character, 1) as simulator:
        mixed = simulator.run_open_loop(walk.q[20], walk.v[20], np.stack([bad, good]))
        alone = simulator.run_open_loop(walk.q[20], walk.v[20], good[None])
    assert list(mixed[4]) == [True, False]
    assert np.array_equal(mixed[0][1], alone[0][0])

"""Pushes have the impulse that they should, and survival is what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physique.character import kinematics
from physique.commands.push import push
from physique.errors import InputError
from physique.feedback.pushes import random_pushes, recovery_time
from physique.runs.run import Run
from physique.simulation.rollout import simulate
from physique.simulation.stepper import Push, Stepper


def test_pushes_have_the_impulse_and_all_directions() -> None:
    pushes = random_pushes(np.random.default_rng(0), 2000, 50.0, 10, (3, 9), 0.01)
    force = np.array([p.force for p in pushes])
    np.testing.assert_allclose(np.linalg.norm(force, axis=1) * 0.1, 50.0)
    assert np.abs(force.mean(axis=0)).max() < 30.0  # of 500 N
    assert {p.start for p in pushes} == set(range(3, 10))
    assert {p.part for p in pushes} == set(range(22))
    again = random_pushes(np.random.default_rng(0), 2000, 50.0, 10, (3, 9), 0.01)
    assert pushes == again
    few = random_pushes(np.random.default_rng(0), 50, 50.0, 10, (3, 9), 0.01, parts=(4, 7))
    assert {p.part for p in few} == {4, 7}


def test_a_push_adds_its_impulse(run: Run) -> None:
    """In the air nothing but gravity and the push changes the momentum."""
    character = run.character()
    q, v = run.trajectory.q[0].copy(), np.zeros(56)
    q[2] += 5.0
    hold = lambda t, q, v: q[7:]  # noqa: E731
    moved, _ = simulate(Stepper(character.model), q, v, 20, hold, Push(5, (100.0, -50.0, 20.0), 4, 10))
    pose = kinematics.poses(character, moved.q)
    velocity = kinematics.com_velocity(pose.com_jacobian, moved.v)
    gained = character.mass * (velocity[-1] - [0, 0, -9.81 * 0.2])
    np.testing.assert_allclose(gained, [10.0, -5.0, 2.0], rtol=0.02, atol=0.1)


def test_recovery_is_when_the_motion_is_performed_again_for_good() -> None:
    rng = np.random.default_rng(1)
    wanted = rng.normal(size=(80, 22, 3))
    off = wanted.copy()
    off[5:12] += np.array([0.06, 0.0, 0.0])
    assert recovery_time(off, wanted, 0.01) == pytest.approx(0.12)
    beside = wanted + np.array([0.3, -0.2, 0.0])  # it may stand elsewhere,
    assert recovery_time(beside, wanted, 0.01) == 0.0
    beside[:20] = wanted[:20]  # and has recovered once it is there,
    assert recovery_time(beside, wanted, 0.01) == pytest.approx(0.2)
    lower = wanted - np.array([0.0, 0.0, 0.1])  # but not lower,
    assert recovery_time(lower, wanted, 0.01) is None
    drifting = wanted + np.linspace(0.0, 0.4, 80)[:, None, None]  # nor going on.
    assert recovery_time(drifting, wanted, 0.01) is None


def test_the_same_seed_gives_the_same_trials(folder: Path) -> None:
    reports = [push(folder, 20.0, trials=4, seed=s, start=0.0, end=0.2)[0] for s in (1, 1, 2)]
    assert reports[0].survived == reports[1].survived
    assert reports[0].delta_v == pytest.approx(20.0 / 75.0, rel=0.05)
    trials = [push(folder, 20.0, trials=4, seed=s, start=0.0, end=0.2)[1] for s in (1, 2)]
    assert [t.push for t in trials[0]] != [t.push for t in trials[1]]
    assert [t.error for t in trials[0]] != [t.error for t in trials[1]]


def test_a_hard_push_is_not_survived_and_none_is(folder: Path) -> None:
    report, trials = push(folder, 1000.0, trials=3, start=0.0, end=0.1, controller="lqr")
    assert report.survived == 0
    assert all(t.error > 0.5 for t in trials)
    assert push(folder, 0.0, trials=2, start=0.0, end=0.1)[0].survived == 2


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"impulse": -1.0}, "--impulse"),
        ({"impulse": 5.0, "duration": 9.0}, "--duration"),
        ({"impulse": 5.0, "trials": 0}, "--trials"),
        ({"impulse": 5.0, "start": 3.0}, "--from"),
        ({"impulse": 5.0, "start": 0.2, "end": 0.1}, "--to"),
        ({"impulse": 5.0, "seed": -1}, "--seed"),
    ],
)
def test_bad_values_are_refused(folder: Path, options: dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        push(folder, **options)

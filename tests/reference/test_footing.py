"""The reference's feet: on the floor where they stand, smooth everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from physique.character import kinematics
from physique.character.model import Character
from physique.character.soles import feet, sole_points
from physique.character.state import finite_velocity
from physique.motion.read import read_motion
from physique.reference.banded import LeastSquares
from physique.reference.reference import Reference, make_reference


@pytest.mark.parametrize("frames", [1, 2, 3, 8])
def test_banded_solution_is_that_of_a_general_solver(frames: int) -> None:
    rng = np.random.default_rng(frames)
    n, columns = 4, np.array([0, 2, 3])
    rows: list[np.ndarray] = []
    wanted: list[float] = []

    def row(weight: float, residual: float, **at: np.ndarray) -> None:
        line = np.zeros((frames, n))
        for t, values in at.items():
            line[int(t[1:])] = values
        rows.append(weight * line.ravel())
        wanted.append(-weight * residual)

    def spread(values: np.ndarray) -> np.ndarray:
        out = np.zeros(n)
        out[columns] = values
        return out

    problem = LeastSquares(frames, n)
    r, J, w = rng.normal(size=(frames, 2)), rng.normal(size=(frames, 2, 3)), rng.random((frames, 1))
    problem.add(r, J, w, columns)
    for t in range(frames):
        for k in range(2):
            row(w[t, 0], r[t, k], **{f"t{t}": spread(J[t, k])})
    r, A, B = rng.normal(size=(frames - 1, 2)), *rng.normal(size=(2, frames - 1, 2, 3))
    w = rng.random((frames - 1, 2))
    problem.add_pairs(r, A, B, w, columns)
    for t in range(frames - 1):
        for k in range(2):
            row(w[t, k], r[t, k], **{f"t{t}": spread(A[t, k]), f"t{t + 1}": spread(B[t, k])})
    x, small, smooth = rng.normal(size=(frames, n)), rng.random(n) + 0.1, rng.random(n)
    problem.keep_small(x, small)
    problem.keep_smooth(x, smooth)
    for t in range(frames):
        for j in range(n):
            one = np.eye(n)[j]
            row(small[j], x[t, j], **{f"t{t}": one})
            if t < frames - 2:
                bend = x[t, j] - 2 * x[t + 1, j] + x[t + 2, j]
                row(smooth[j], bend, **{f"t{t}": one, f"t{t + 1}": -2 * one, f"t{t + 2}": one})
    expected = np.linalg.lstsq(np.array(rows), np.array(wanted), rcond=None)[0]
    assert np.abs(problem.solve().ravel() - expected).max() < 1e-9


def test_derivatives_of_the_feet(character: Character, walk: Reference) -> None:
    q = walk.q[30:34]
    now = feet(character, q)
    h = 1e-6
    for side in range(2):
        for j in range(8):
            moved = q.copy()
            moved[:, 7 + 8 * side + j] += h  # the legs are the first angles
            then = feet(character, moved)
            for of, by in (("points", "by_angle"), ("ankles", "ankles_by_angle")):
                found = (getattr(then, of) - getattr(now, of))[:, side] / h
                assert np.abs(found - getattr(now, by)[:, side, ..., j]).max() < 1e-5
            turn = (then.R_world_from_foot - now.R_world_from_foot)[:, side] / h
            spin = turn @ np.swapaxes(now.R_world_from_foot[:, side], 1, 2)
            vector = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
            assert np.abs(vector - now.turn_by_angle[:, side, :, j]).max() < 1e-5


@pytest.mark.parametrize("clip", ["walk", "run", "punch"])
def test_standing_feet_touch_the_floor_and_none_is_in_it(character: Character, clip: str) -> None:
    reference = make_reference(read_motion(clip), character)
    lowest = sole_points(character, reference.q)[..., 2].min(axis=-1)
    assert np.abs(lowest[reference.contacts]).max() < 0.01
    assert np.abs(lowest[reference.contacts]).mean() < 0.002
    assert lowest.min() > -0.01


def test_legs_do_not_snap(character: Character) -> None:
    # In the run a leg is straight when its foot is to be moved aside.
    motion = read_motion("run")
    reference = make_reference(motion, character)
    acceleration = np.diff(finite_velocity(reference.q, 0.01), axis=0) / 0.01
    assert np.abs(acceleration[:, 6:22]).max() < 1500.0


def test_standing_feet_creep_less_than_the_performers(character: Character) -> None:
    reference = make_reference(read_motion("walk"), character)
    stands = reference.contacts[1:] & reference.contacts[:-1]
    points = sole_points(character, reference.q)
    low = points[:-1, ..., 2] < 0.002
    pace = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1) / reference.timestep
    assert np.median(pace[low & stands[..., None]]) < 0.03


@pytest.mark.parametrize("clip", ["crawl", "getup_facedown"])
def test_a_body_that_does_not_fall_is_on_the_floor(character: Character, clip: str) -> None:
    # Nothing stands there that would tell the height of the floor.
    reference = make_reference(read_motion(clip), character)
    lowest = kinematics.poses(character, reference.q).lowest.min(axis=1)
    assert np.abs(lowest).mean() < 0.02
    assert np.abs(lowest).max() < 0.06

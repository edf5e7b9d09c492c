"""A and B against differences of whole simulator steps, on the manifold."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np

from physique.character.model import Character, make_character
from physique.character.state import difference, integrate
from physique.derivatives.linearize import linearize
from physique.derivatives.smooth import make_tree

Step = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
EPSILON = 1e-6
COLUMNS = {"dq": slice(0, 56), "dv": slice(56, 112), "du": slice(112, 162)}


def differences(step: Step, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """[A B] (112, 162) by centred differences of the step."""
    AB = np.empty((112, 162))
    for i in range(162):
        ends = []
        for sign in (-EPSILON, EPSILON):
            d = np.zeros(162)
            d[i] = sign
            ends.append(step(integrate(q, d[:56]), v + d[56:112], u + d[112:]))
        (qa, va), (qb, vb) = ends
        AB[:56, i] = difference(qa, qb) / (2 * EPSILON)
        AB[56:, i] = (vb - va) / (2 * EPSILON)
    return AB


def analytic(character: Character, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    with ThreadPoolExecutor(1) as executor:
        datas = [mujoco.MjData(character.model)]
        tree = make_tree(character.model)
        found = linearize(character, tree, datas, executor, q[None], v[None], u[None])
    return np.hstack(found.matrices(0))


def test_matches_differences_of_steps_in_contact(character: Character, moments: list, step: Step) -> None:
    for moment in moments:
        expected = differences(step, moment.q, moment.v, moment.u)
        got = analytic(character, moment.q, moment.v, moment.u)
        for name, columns in COLUMNS.items():
            error = np.linalg.norm(got[:, columns] - expected[:, columns])
            assert error < 2e-3 * np.linalg.norm(expected[:, columns]), name


def test_a_step_along_the_derivative_is_right_to_second_order(
    character: Character, moments: list, step: Step
) -> None:
    moment = moments[1]
    AB = analytic(character, moment.q, moment.v, moment.u)
    q_next, v_next = step(moment.q, moment.v, moment.u)
    rng = np.random.default_rng(0)
    direction = rng.normal(size=162)
    direction[56:112] *= 10

    def missed(scale: float) -> float:
        d = scale * direction
        q, v = step(integrate(moment.q, d[:56]), moment.v + d[56:112], moment.u + d[112:])
        actual = np.concatenate([difference(q_next, q), v - v_next])
        return float(np.linalg.norm(actual - AB @ d) / np.linalg.norm(AB @ d))

    assert missed(1e-6) < 2e-3
    assert missed(1e-5) < 5e-3


def test_orientation_of_a_spinning_body(character: Character, moments: list, step: Step) -> None:
    # At 27 rad/s a step turns the pelvis by 0.27 rad: the curvature of rotations counts.
    moment = moments[0]
    q, v = moment.q.copy(), moment.v.copy()
    q[2] += 0.5
    v[3:6] = [10.0, 20.0, -15.0]
    got = analytic(character, q, v, moment.u)[3:6, :112]
    expected = differences(step, q, v, moment.u)[3:6, :112]
    for columns in (slice(0, 56), slice(56, 112)):
        error = np.abs(got[:, columns] - expected[:, columns]).max()
        assert error < 1e-3 * np.abs(expected[:, columns]).max()


def test_in_flight_it_agrees_with_mujocos_own_derivatives(character: Character, moments: list) -> None:
    model = character.model
    data = mujoco.MjData(model)
    moment = moments[0]
    q = moment.q.copy()
    q[2] += 0.5
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, moment.v, moment.u
    A, B = np.empty((112, 112)), np.empty((112, 50))
    mujoco.mjd_transitionFD(model, data, EPSILON, True, A, B, None, None)
    got = analytic(character, q, moment.v, moment.u)
    np.testing.assert_allclose(got[:, :112], A, atol=2e-4 * np.abs(A).max())
    np.testing.assert_allclose(got[:, 112:], B, atol=2e-4 * np.abs(B).max())


def test_gives_the_state_that_the_step_leads_to(character: Character, moments: list, step: Step) -> None:
    q, v, u = (np.stack([getattr(m, name) for m in moments]) for name in "qvu")
    with ThreadPoolExecutor(2) as executor:
        datas = [mujoco.MjData(character.model) for _ in range(2)]
        found = linearize(character, make_tree(character.model), datas, executor, q, v, u)
    for t in range(len(q)):
        q_next, v_next = step(q[t], v[t], u[t])
        assert np.abs(difference(q_next, found.q[t])).max() < 1e-12
        np.testing.assert_allclose(found.v[t], v_next, atol=1e-12)


def test_a_target_beyond_its_limit_has_no_derivative(character: Character, moments: list, step: Step) -> None:
    # A knee held back at its limit: its target no longer moves anything.
    weak = make_character(character.body, 5.0)
    moment = moments[0]
    u = moment.q[7:].copy()
    u[3] += 0.5
    q, v = moment.q.copy(), moment.v.copy()
    q[2] += 0.5
    v[6:] = 0.0
    got = analytic(weak, q, v, u)
    assert np.all(got[:, 112 + 3] == 0.0)
    assert np.abs(got[:, 112 + 4]).max() > 0.0


def test_a_limit_without_a_short_decimal_is_a_limit_too(character: Character) -> None:
    # MJCF text keeps six digits: the model's limit is 33.3333, and that is where it saturates.
    weak = make_character(character.body, 100 / 3)
    q, v, u = np.zeros(57), np.zeros(56), np.zeros(50)
    q[2], q[3], u[3] = 2.0, 1.0, 0.5
    assert np.all(analytic(weak, q, v, u)[:, 112 + 3] == 0.0)


def test_threads_give_the_same_bits(character: Character, moments: list) -> None:
    # More steps than one worker takes at a time.
    q, v, u = (np.stack([getattr(m, name) for m in moments] * 15) for name in "qvu")
    results = []
    for threads in (1, 2):
        with ThreadPoolExecutor(threads) as executor:
            datas = [mujoco.MjData(character.model) for _ in range(threads)]
            tree = make_tree(character.model)
            results.append(linearize(character, tree, datas, executor, q, v, u))
    for name in ("q", "mass", "drive", "gain"):
        assert np.array_equal(getattr(results[0], name), getattr(results[1], name))

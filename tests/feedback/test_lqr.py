"""The Riccati recursion against general solvers, the derivatives against plain MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from physique.character.state import difference, integrate
from physique.feedback import lqr
from physique.feedback.connect import Trunk
from physique.runs.run import Run
from physique.simulation.mujoco_simulator import MujocoSimulator


def system(seed: int, steps: int, n: int = 5, m: int = 2) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    A = np.eye(n) + 0.3 * rng.normal(size=(steps, n, n))
    B = rng.normal(size=(steps, n, m))
    square = rng.normal(size=(steps + 1, n, n))
    Q = square @ np.swapaxes(square, 1, 2)
    R = np.tile(np.diag(rng.uniform(0.1, 2.0, size=m)), (steps, 1, 1))
    return A, B, Q, R


@given(st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_the_gains_solve_the_whole_program(seed: int) -> None:
    """All controls at once, as one least-squares problem over the horizon."""
    steps, n, m = 4, 5, 2
    A, B, Q, R = system(seed, steps)
    L, K = lqr.riccati(A, B, Q, R)
    x0 = np.random.default_rng(seed + 1).normal(size=n)
    # x = F x0 + G u, stacked.
    F, G = [np.eye(n)], [np.zeros((n, steps * m))]
    for t in range(steps):
        row = A[t] @ G[-1]
        row[:, t * m : (t + 1) * m] += B[t]
        F.append(A[t] @ F[-1])
        G.append(row)
    H = sum(g.T @ q @ g for g, q in zip(G, Q)) + scipy.linalg.block_diag(*R)
    u = -np.linalg.solve(H, sum(g.T @ q @ f for f, g, q in zip(F, G, Q)) @ x0)
    x, cost = x0, 0.0
    for t in range(steps):
        by_gain = L[t] @ x
        np.testing.assert_allclose(by_gain, u[t * m : (t + 1) * m], rtol=1e-6, atol=1e-8)
        cost += x @ Q[t] @ x + by_gain @ R[t] @ by_gain
        x = A[t] @ x + B[t] @ by_gain
    assert cost + x @ Q[-1] @ x == pytest.approx(x0 @ K[0] @ x0, rel=1e-8)


def test_a_long_horizon_is_the_algebraic_riccati_equation() -> None:
    A, B, Q, R = (a[:1] for a in system(3, 1))
    steps = 300
    L, K = lqr.riccati(
        *(np.tile(a, (k, 1, 1)) for a, k in zip((A, B, Q, R), (steps, steps, steps + 1, steps)))
    )
    expected = scipy.linalg.solve_discrete_are(A[0], B[0], Q[0], R[0])
    np.testing.assert_allclose(K[0], expected, rtol=1e-8)
    assert np.abs(np.linalg.eigvals(A[0] + B[0] @ L[0])).max() < 1


def test_the_closed_loop_is_that_of_the_simulator(run: Run) -> None:
    """A + B L by torques, against central differences of MuJoCo steps under the target gains."""
    character, motion = run.character(), run.trajectory
    t = 20
    q, v, u = motion.q[t], motion.v[t], motion.control[t]
    with MujocoSimulator(character, 1) as simulator:
        linear = simulator.linearize(q[None], v[None], u[None], motion.v[t + 1][None])
    A, B = lqr.torque_system(character, linear)
    L = lqr.riccati(A, B, *lqr.cost_matrices(character, motion.q[t : t + 2], lqr.LqrWeights()))[0]
    U = lqr.target_gains(character, A, B, L)[0]
    data = mujoco.MjData(character.model)

    def step(dx: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(character.model, data)
        data.qpos[:], data.qvel[:] = integrate(q, dx[:56]), v + dx[56:]
        data.ctrl[:] = u + U @ dx
        mujoco.mj_step(character.model, data)
        return np.concatenate([difference(motion.q[t + 1], data.qpos), data.qvel - motion.v[t + 1]])

    closed = A[0] + B[0] @ L[0]
    for i in range(112):
        dx = 1e-6 * np.eye(112)[i]
        column = (step(dx) - step(-dx)) / 2e-6
        assert np.linalg.norm(closed[:, i] - column) < 2e-2 * max(1.0, np.linalg.norm(column)), i


def test_both_forms_of_the_gains_have_the_same_closed_loop(run: Run) -> None:
    character, motion = run.character(), run.trajectory
    part = slice(10, 20)
    with MujocoSimulator(character, 1) as simulator:
        linear = simulator.linearize(motion.q[part], motion.v[part], motion.control[part])
    A, B = lqr.torque_system(character, linear)
    Q, R = lqr.cost_matrices(character, motion.q[10:21], lqr.LqrWeights())
    L, _ = lqr.riccati(A, B, Q, R)
    U = lqr.target_gains(character, A, B, L)
    for t in range(10):
        by_torque = A[t] + B[t] @ L[t]
        A_target, B_target = linear.matrices(t)
        np.testing.assert_allclose(by_torque, A_target + B_target @ U[t], atol=1e-9)


def test_the_papers_weights_are_the_papers(run: Run) -> None:
    Q, R = lqr.cost_matrices(run.character(), run.trajectory.q[:2], "paper")
    assert np.array_equal(Q[0], np.eye(112))
    assert sorted(set(np.diag(R[0]))) == [1.0, 15.0]
    assert np.sum(np.diag(R[0]) == 15.0) == 9  # three joints of the spine


def test_the_cost_to_go_is_a_cost(trunk: Trunk) -> None:
    for K in trunk.cost_to_go[::20]:
        np.testing.assert_allclose(K, K.T)
        assert np.linalg.eigvalsh(K)[0] > -1e-6

"""The fast optimiser: its backward pass is exact on linear problems, its descent is real."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from physique.character.state import integrate
from physique.derivatives.linearize import Linearization
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.rollout import Rollout
from physique.tracking import ddp
from physique.tracking.backward import LinearPolicy, backward
from physique.tracking.costs import Quadratic
from physique.tracking.problem import Problem, Solution

NX, NU = 112, 50
TINY = 1e-10  # damping
SMALL = 1e-4  # gradients


def matrices(linear: Linearization) -> tuple[np.ndarray, np.ndarray]:
    """A and B of the toy's steps, which are all the same."""
    return linear.matrices(0)


def toy(
    problem: Problem, steps: int, gaps: np.ndarray, seed: int = 0
) -> tuple[Rollout, Linearization, Quadratic]:
    """A random linear-quadratic problem about a motion at rest."""
    rng = np.random.default_rng(seed)
    q = np.tile(problem.q0, (steps + 1, 1))
    rollout = Rollout(
        q=q,
        v=np.zeros((steps + 1, 56)),
        control=np.zeros((steps, NU)),
        torque=np.zeros((steps, NU)),
        com=np.zeros((steps + 1, 3)),
        com_velocity=np.zeros((steps + 1, 3)),
        diverged=False,
    )
    # A timestep of 1 couples positions to velocities as strongly as the rest.
    turn = 0.3 * rng.normal(size=(2, 3, 3))
    mass = np.eye(56) + 0.1 * rng.normal(size=(56, 56))
    linear = Linearization(
        q=integrate(q[1:], gaps[:, :56]),
        v=gaps[:, 56:],
        mass=np.tile(mass, (steps, 1, 1)),
        drive=np.tile(rng.normal(size=(56, NX)) / np.sqrt(NX), (steps, 1, 1)),
        gain=np.tile(1 + rng.uniform(size=NU), (steps, 1)),
        transport=np.tile(np.eye(3) + turn[0], (steps, 1, 1)),
        rotation=np.tile(np.eye(3) + turn[1], (steps, 1, 1)),
        timestep=0.5,
    )
    root = rng.normal(size=(steps + 1, 2, 56, 56)) / np.sqrt(56)
    hessian = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(56)
    # Small enough that no torque limit is in reach.
    return rollout, linear, Quadratic(SMALL * rng.normal(size=(steps + 1, NX)), hessian)


def full(hessian: np.ndarray) -> np.ndarray:
    """Hessians (T, 112, 112)."""
    return np.array([block_diag(*h) for h in hessian])


def lq_cost(
    u: np.ndarray, linear: Linearization, quadratic: Quadratic, gaps: np.ndarray
) -> tuple[float, np.ndarray]:
    """Cost of controls u (N, 50) from x = 0, and the states."""
    A, B = matrices(linear)
    x = np.zeros((len(u) + 1, NX))
    for t in range(len(u)):
        x[t + 1] = A @ x[t] + B @ u[t] + gaps[t]
    cost = np.sum(quadratic.gradient * x)
    return float(cost + 0.5 * np.einsum("ti,tij,tj->", x, full(quadratic.hessian), x)), x


def dense_optimum(linear: Linearization, quadratic: Quadratic, gaps: np.ndarray) -> np.ndarray:
    """The best controls (N, 50): all steps stacked into one linear system."""
    steps = len(gaps)
    A, B = matrices(linear)
    G = np.zeros((steps + 1, NX, steps * NU))
    for t in range(steps):
        G[t + 1] = A @ G[t]
        G[t + 1][:, t * NU : (t + 1) * NU] += B
    _, free = lq_cost(np.zeros((steps, NU)), linear, quadratic, gaps)
    normal = np.einsum("tij,tik,tkl->jl", G, full(quadratic.hessian), G, optimize=True)
    slope = quadratic.gradient + np.einsum("tij,tj->ti", full(quadratic.hessian), free)
    return np.linalg.solve(normal, -np.einsum("tij,ti->j", G, slope)).reshape(steps, NU)


@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_backward_is_the_optimum_of_a_linear_problem(problem: Problem, gap: float) -> None:
    steps = 4
    gaps = SMALL * gap * np.random.default_rng(9).normal(size=(steps, NX))
    rollout, linear, quadratic = toy(problem, steps, gaps)
    policy = backward(problem, rollout, linear, quadratic, TINY)
    assert policy is not None
    A, B = matrices(linear)
    x, u = np.zeros(NX), np.empty((steps, NU))
    for t in range(steps):
        u[t] = policy.feedforward[t] + policy.feedback[t] @ x
        x = A @ x + B @ u[t] + gaps[t]
    best = dense_optimum(linear, quadratic, gaps)
    np.testing.assert_allclose(u, best, atol=1e-5 * SMALL)
    if gap == 0.0:
        decrease = -lq_cost(best, linear, quadratic, gaps)[0]
        assert policy.gain == pytest.approx(decrease, rel=1e-6)


def test_far_from_the_end_its_gain_is_the_riccati_equations(problem: Problem) -> None:
    steps = 60
    gaps = np.zeros((steps, NX))
    rollout, linear, quadratic = toy(problem, steps, gaps)
    # Calm enough that 60 steps are far.
    drive = 0.5 * linear.drive
    drive[:, :, 56:] -= 0.7 * linear.mass / linear.timestep
    linear = replace(linear, drive=drive, transport=0.7 * linear.transport)
    A, B = matrices(linear)
    same = Quadratic(0 * quadratic.gradient, np.tile(np.eye(56), (steps + 1, 2, 1, 1)))
    policy = backward(problem, rollout, linear, same, TINY)
    assert policy is not None
    V = solve_discrete_are(A, B, np.eye(NX), 1e-9 * np.eye(NU))
    K = -np.linalg.solve(B.T @ V @ B, B.T @ V @ A)
    np.testing.assert_allclose(policy.feedback[0], K, atol=1e-4 * np.abs(K).max())


def test_damping_shortens_the_step(problem: Problem) -> None:
    rollout, linear, quadratic = toy(problem, 3, np.zeros((3, NX)))
    sizes = []
    for damping in (TINY, 1.0, 100.0):
        policy = backward(problem, rollout, linear, quadratic, damping)
        assert policy is not None
        sizes.append(np.linalg.norm(policy.feedforward))
    assert sizes[0] > sizes[1] > sizes[2] > 0


def test_targets_at_their_limit_do_not_push_on(problem: Problem) -> None:
    rollout, linear, quadratic = toy(problem, 3, np.zeros((3, NX)))
    free = backward(problem, rollout, linear, quadratic, 1.0)
    assert free is not None
    wish = free.feedforward[2]
    out, back = int(np.argmax(wish)), int(np.argmin(wish))
    torque = rollout.torque.copy()
    torque[2, [out, back]] = problem.character.torque_limit[[out, back]]
    held = backward(problem, replace(rollout, torque=torque), linear, quadratic, 1.0)
    assert held is not None
    assert abs(held.feedforward[2, out]) < 1e-6
    # The joint keeps its torque when it moves: kp (du - dq) - kd dv = 0.
    row = np.zeros(NX)
    row[6 + out], row[62 + out] = 1.0, 1.0 / 700.0
    np.testing.assert_allclose(held.feedback[2, out], row, atol=1e-12)
    assert held.feedforward[2, back] < 0.0  # away from the limit is allowed


def test_it_plans_with_the_limits_of_the_others(problem: Problem) -> None:
    # A limit that a step would cross is met exactly, and the other joints make up for it.
    rollout, linear, quadratic = toy(problem, 1, np.zeros((1, NX)))
    free = backward(problem, rollout, linear, quadratic, 1.0)
    assert free is not None
    out = int(np.argmax(free.feedforward[0]))
    room = free.feedforward[0, out] / 2
    torque = rollout.torque.copy()
    torque[0, out] = problem.character.torque_limit[out] * (1 - 1e-6) - 700.0 * room
    held = backward(problem, replace(rollout, torque=torque), linear, quadratic, 1.0)
    assert held is not None
    assert held.feedforward[0, out] == pytest.approx(room)
    _, B = matrices(linear)
    V = B.T @ full(quadratic.hessian)[1] @ B + np.eye(NU)
    slope = B.T @ quadratic.gradient[1] + V @ held.feedforward[0]
    others = np.arange(NU) != out
    np.testing.assert_allclose(slope[others], 0.0, atol=1e-8 * abs(slope[out]))
    assert slope[out] < 0.0


def solve(problem: Problem, nominal: Rollout, threads: int) -> tuple[Solution, int]:
    with MujocoSimulator(problem.character, threads) as simulator:
        solution = ddp.solve(problem, simulator, nominal, ddp.DdpOptions(iterations=8))
        return solution, simulator.steps


@pytest.fixture(scope="module")
def solved(problem: Problem, nominal: Rollout) -> tuple[Solution, int]:
    return solve(problem, nominal, 1)


def test_it_lowers_the_cost_of_a_walk(
    problem: Problem, nominal: Rollout, solved: tuple[Solution, int]
) -> None:
    solution, steps = solved
    with MujocoSimulator(problem.character, 1) as simulator:
        replayed = simulator.run(problem.q0, problem.v0, problem.steps, [lambda t, q, v: nominal.control[t]])[
            0
        ]
    assert solution.cost < 0.3 * problem.cost(replayed)
    assert solution.cost < 0.8 * solution.history[0]
    assert all(b < a for a, b in zip(solution.history, solution.history[1:]))
    assert solution.steps == steps
    # The torques respect the limits, the motion is near the reference.
    assert np.abs(solution.rollout.torque).max() <= 100.0
    away = solution.rollout.com - problem.target.com
    assert np.linalg.norm(away, axis=1).max() < 0.05


def test_its_controls_alone_replay_the_motion(problem: Problem, solved: tuple[Solution, int]) -> None:
    best = solved[0].rollout
    with MujocoSimulator(problem.character, 1) as simulator:
        again = simulator.run(problem.q0, problem.v0, problem.steps, [lambda t, q, v: best.control[t]])[0]
    assert np.array_equal(again.q, best.q)
    assert np.array_equal(again.v, best.v)
    assert problem.cost(again) == solved[0].cost == solved[0].history[-1]


def test_same_bits_on_two_threads(problem: Problem, nominal: Rollout, solved: tuple[Solution, int]) -> None:
    other, steps = solve(problem, nominal, 2)
    assert other.history == solved[0].history
    assert np.array_equal(other.rollout.q, solved[0].rollout.q)
    assert steps == solved[1]


def test_hard_windows_are_searched_again_and_the_best_is_kept(problem: Problem, nominal: Rollout) -> None:
    restarts = ((30.0, 0.3), (0.3, 1.0))
    alone = ddp.DdpOptions(iterations=4, restarts=())
    costs, steps = [], 0
    with MujocoSimulator(problem.character, 1) as simulator:
        for damping, kink in restarts:
            one = replace(alone, damping=damping, start_dampings=(damping,), first_kink=kink)
            costs.append(ddp.solve(problem, simulator, nominal, one).cost)
        first = ddp.solve(problem, simulator, nominal, alone)
        steps, told = simulator.steps, []
        again = replace(alone, restarts=restarts, hard=0.99 * first.cost)
        found = ddp.solve(problem, simulator, nominal, again, lambda i, c: told.append((i, c)))
        easy = ddp.solve(problem, simulator, nominal, replace(again, hard=1.01 * first.cost))
    assert found.cost == min(first.cost, *costs)
    assert len({first.cost, *costs}) == 3
    assert found.steps == steps
    assert [i for i, _ in told] == list(range(1, len(told) + 1))
    assert all(after <= before for (_, before), (_, after) in pairwise(told))
    assert (easy.cost, easy.steps) == (first.cost, first.steps)


def test_the_policy_with_no_step_repeats_the_motion(problem: Problem, solved: tuple[Solution, int]) -> None:
    best = solved[0].rollout
    gain = 1e-3 * np.random.default_rng(0).normal(size=(problem.steps, NU, NX))
    policy = LinearPolicy(np.ones((problem.steps, NU)), gain, 0.0)
    with MujocoSimulator(problem.character, 1) as simulator:
        again = simulator.run(
            problem.q0, problem.v0, problem.steps, [ddp.closed_loop(problem, best, policy, 0.0)]
        )[0]
    np.testing.assert_allclose(again.q, best.q, atol=1e-6)

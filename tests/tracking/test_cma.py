"""The paper's optimiser."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physique.errors import InputError
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.rollout import Rollout
from physique.tracking import cma
from physique.tracking.problem import Problem, Solution
from physique.tracking.spline import knot_matrix

SMALL = cma.CmaOptions(samples=16, iterations=4, sigma=0.05)


def solve(problem: Problem, nominal: Rollout, options: cma.CmaOptions, threads: int = 1) -> Solution:
    with MujocoSimulator(problem.character, threads) as simulator:
        return cma.solve(problem, simulator, nominal, options)


@pytest.fixture(scope="module")
def small(problem: Problem, nominal: Rollout) -> Solution:
    return solve(problem, nominal, SMALL)


def test_defaults_are_the_papers() -> None:
    options = cma.CmaOptions()
    assert options.samples * options.iterations == 400_000
    assert (options.sigma, options.knots_per_window) == (0.3, 6)
    assert not options.warm_start


def test_same_bits_on_two_threads_and_again(problem: Problem, nominal: Rollout, small: Solution) -> None:
    np.random.seed(1)  # noqa: NPY002  (the global generator must not matter)
    other = solve(problem, nominal, SMALL, threads=2)
    assert other.history == small.history
    assert np.array_equal(other.rollout.q, small.rollout.q)
    different = solve(problem, nominal, replace(SMALL, seed=1))
    assert different.history != small.history


def test_the_global_generator_is_left_alone(problem: Problem, nominal: Rollout) -> None:
    np.random.seed(7)  # noqa: NPY002
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    solve(problem, nominal, replace(SMALL, iterations=1))
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_solution_is_what_its_controls_do(problem: Problem, small: Solution) -> None:
    control = small.rollout.control
    with MujocoSimulator(problem.character, 1) as simulator:
        again = simulator.run(problem.q0, problem.v0, problem.steps, [lambda t, q, v: control[t]])[0]
    assert np.array_equal(again.q, small.rollout.q)
    assert small.cost == problem.cost(small.rollout)
    assert small.cost == pytest.approx(small.history[-1], rel=1e-12)
    # The controls are a spline: its matrix reproduces them.
    matrix = knot_matrix(6, problem.steps)
    knots = np.linalg.lstsq(matrix, control, rcond=None)[0]
    np.testing.assert_allclose(matrix @ knots, control, atol=1e-10)


def test_starts_at_zero_and_never_gets_worse(problem: Problem, nominal: Rollout, small: Solution) -> None:
    with MujocoSimulator(problem.character, 1) as simulator:
        zero = simulator.run(problem.q0, problem.v0, problem.steps, [lambda t, q, v: np.zeros(50)])[0]
    assert small.history[0] == pytest.approx(problem.cost(zero), rel=1e-12)
    assert all(b <= a for a, b in zip(small.history, small.history[1:]))
    assert small.history[-1] < small.history[0]


def test_every_simulated_step_is_counted(problem: Problem, small: Solution) -> None:
    n = problem.steps
    # The start, 4 generations of 16 open-loop simulations (one step more each for the sensors of
    # the last frame), and the replay.
    assert small.steps == (1 + 4 * 16) * (n + 1) + n
    assert len(small.history) == 5


def test_warm_start_begins_at_the_nominal_controls(problem: Problem, nominal: Rollout) -> None:
    cold = solve(problem, nominal, replace(SMALL, iterations=1))
    warm = solve(problem, nominal, replace(SMALL, iterations=1, warm_start=True))
    assert warm.history[0] < 0.7 * cold.history[0]


def test_it_descends(problem: Problem, nominal: Rollout) -> None:
    options = cma.CmaOptions(samples=12, iterations=25, sigma=0.02, warm_start=True)
    solution = solve(problem, nominal, options)
    assert solution.cost < 0.8 * solution.history[0]
    assert solution.status == "iterations"


@pytest.mark.parametrize(("option", "value"), [("samples", 1), ("iterations", 0), ("sigma", 0.0)])
def test_impossible_options_are_refused(option: str, value: float) -> None:
    with pytest.raises(InputError, match=option):
        cma.CmaOptions(**{option: value})

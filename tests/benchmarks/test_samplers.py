"""The rivals' samplers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from compare_optimizers import start_nominal
from physique.errors import InputError
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.simulator import Simulator
from physique.tracking import cma
from physique.tracking.problem import Problem, Solution
from samplers import CemOptions, MppiOptions, annealed_mppi, incremental_cem

Sampler = tuple[Callable[..., Solution], Any]

SAMPLERS = {
    "cem": (incremental_cem, CemOptions(samples=16, elite=0.25, sigma=0.05, budget=3_500)),
    "mppi": (annealed_mppi, MppiOptions(samples=16, elite=0.25, sigma=0.05, budget=3_500)),
}


@pytest.fixture(scope="module", params=SAMPLERS)
def sampler(request: pytest.FixtureRequest) -> Sampler:
    return SAMPLERS[request.param]


def solve(
    problem: Problem,
    sampler: Sampler,
    threads: int = 1,
    objective: cma.Objective = cma.evaluate,
    **changes: object,
) -> tuple[Solution, list[tuple[int, float]]]:
    function, options = sampler
    calls: list[tuple[int, float]] = []
    with MujocoSimulator(problem.character, threads) as simulator:
        solution = function(
            problem,
            simulator,
            start_nominal(problem),
            replace(options, **changes),
            lambda iteration, cost: calls.append((iteration, cost)),
            objective,
        )
        assert solution.steps == simulator.steps
    return solution, calls


@pytest.fixture(scope="module")
def found(problem: Problem, sampler: Sampler) -> tuple[Solution, list[tuple[int, float]]]:
    return solve(problem, sampler)


def test_defaults_are_as_published() -> None:
    cem, mppi = CemOptions(), MppiOptions()
    assert (cem.samples, cem.elite, cem.spacing) == (1024, 0.04, 0.25)
    assert (mppi.samples, mppi.elite, mppi.spacing) == (2048, 0.1, 0.1)
    assert (mppi.iterations, mppi.annealing) == (16, 0.1)


def test_descends_and_reports_every_iteration(found: tuple[Solution, list[tuple[int, float]]]) -> None:
    solution, calls = found
    assert solution.cost < 0.9 * solution.history[0]
    assert all(b <= a for a, b in zip(solution.history, solution.history[1:]))
    assert [iteration for iteration, _ in calls] == list(range(1, len(solution.history)))
    assert [cost for _, cost in calls] == list(solution.history[1:])


def test_solution_is_what_its_controls_do(
    problem: Problem, found: tuple[Solution, list[tuple[int, float]]]
) -> None:
    rollout = found[0].rollout
    with MujocoSimulator(problem.character, 1) as simulator:
        again = cma.evaluate(problem, simulator, rollout.control[None])[0]
    assert found[0].cost == problem.cost(rollout)
    assert again == pytest.approx(found[0].cost, rel=1e-12)


def test_same_bits_on_two_threads_and_others_for_another_seed(
    problem: Problem, sampler: Sampler, found: tuple[Solution, list[tuple[int, float]]]
) -> None:
    np.random.seed(1)  # noqa: NPY002  (the global generator must not matter)
    other, _ = solve(problem, sampler, threads=2)
    assert other.history == found[0].history
    assert np.array_equal(other.rollout.q, found[0].rollout.q)
    assert solve(problem, sampler, seed=1)[0].history != other.history


def test_never_worse_than_the_best_sample(problem: Problem, sampler: Sampler) -> None:
    seen: list[float] = []

    def watch(part: Problem, simulator: Simulator, control: np.ndarray) -> np.ndarray:
        cost = cma.evaluate(part, simulator, control)
        if part.steps == problem.steps:
            seen.extend(cost)
        return cost

    # Noise so wide that hardly any sample is better than the start.
    solution, _ = solve(problem, sampler, objective=watch, sigma=1.0, budget=2_000)
    assert solution.cost == pytest.approx(min(seen), rel=1e-12)


def test_all_steps_are_counted_and_stay_within_the_budget(
    problem: Problem, sampler: Sampler, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = 0
    plain = MujocoSimulator.run_open_loop

    def count(self: Simulator, q: np.ndarray, v: np.ndarray, control: np.ndarray) -> Any:
        nonlocal taken
        taken += len(control) * (control.shape[1] + 1)
        return plain(self, q, v, control)

    monkeypatch.setattr(MujocoSimulator, "run_open_loop", count)
    solution, _ = solve(problem, sampler, budget=2_000)
    assert solution.steps == taken + problem.steps  # and the last run of the result
    batch = sampler[1].samples * (problem.steps + 1)
    assert 2_000 - batch - 2 * problem.steps < solution.steps <= 2_000
    assert solution.status == "budget"


def test_a_budget_below_one_iteration_leaves_the_start(problem: Problem, sampler: Sampler) -> None:
    solution, calls = solve(problem, sampler, budget=100)
    assert calls == []
    assert len(solution.history) == 1
    assert solution.cost == pytest.approx(solution.history[0], rel=1e-12)


def test_samples_that_blow_up_do_no_harm(problem: Problem, sampler: Sampler) -> None:
    calls = 0

    def fail(part: Problem, simulator: Simulator, control: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        cost = cma.evaluate(part, simulator, control)
        # At first all of a batch, then all but one.
        if len(control) > 1:
            cost[: len(cost) - (calls > 3)] = cma.DIVERGED
        return cost

    solution, _ = solve(problem, sampler, objective=fail)
    assert np.isfinite(solution.cost)
    assert solution.cost <= solution.history[0]


def test_the_horizon_grows_knot_by_knot(problem: Problem) -> None:
    horizons: list[int] = []

    def watch(part: Problem, simulator: Simulator, control: np.ndarray) -> np.ndarray:
        if len(control) > 1:
            horizons.append(part.steps)
        return cma.evaluate(part, simulator, control)

    solve(problem, SAMPLERS["cem"], objective=watch, stage_iterations=3)
    assert horizons[:3] == [25] * 3
    assert set(horizons[3:]) == {30}


@pytest.mark.parametrize(
    ("options", "name", "value"),
    [
        (CemOptions, "samples", 1),
        (CemOptions, "elite", 0.0),
        (CemOptions, "elite", 1.5),
        (CemOptions, "spacing", 0.0),
        (CemOptions, "sigma", float("nan")),
        (CemOptions, "sigma_floor", -0.1),
        (CemOptions, "tolerance", -1.0),
        (CemOptions, "stage_iterations", 0),
        (CemOptions, "budget", 0),
        (MppiOptions, "samples", 1),
        (MppiOptions, "iterations", 0),
        (MppiOptions, "annealing", 2.0),
        (MppiOptions, "temperature", 0.0),
        (MppiOptions, "sigma", float("inf")),
    ],
)
def test_options_refuse_nonsense(options: type, name: str, value: float) -> None:
    with pytest.raises(InputError, match=name) as error:
        options(**{name: value})
    assert str(value) in str(error.value)

"""Searches that are killed go on to the same bits."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import journal
from compare_optimizers import Optimizer, run, search_mark, start_nominal
from journal import Best, Journal, Watched
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.tracking import cma
from physique.tracking.problem import Problem, Solution
from samplers import CemOptions, MppiOptions, annealed_mppi, incremental_cem

CMA = cma.CmaOptions(samples=6, iterations=5, sigma=0.05)
CEM = CemOptions(samples=8, elite=0.25, stage_iterations=2, budget=1_800)
MPPI = MppiOptions(samples=8, iterations=3, budget=1_300)
SAMPLERS: dict[str, Callable[..., Solution]] = {
    "paper": lambda p, s, n, on, ask: cma.solve(p, s, n, CMA, on, ask),
    "cem": lambda p, s, n, on, ask: incremental_cem(p, s, n, CEM, on, ask),
    "mppi": lambda p, s, n, on, ask: annealed_mppi(p, s, n, MPPI, on, ask),
}


class Killed(BaseException):
    pass


def search(problem: Problem, name: str, folder: Path) -> tuple[Solution, Best, list[tuple[int, float]]]:
    """The solution, the best motion and the steps and E of each iteration."""
    best = Best()
    watched = Watched(problem.character, problem.q0, problem.v0, problem.target, problem.weights, best)
    curve: list[tuple[int, float]] = []
    with MujocoSimulator(problem.character, 1) as simulator:
        solution = SAMPLERS[name](
            watched,
            simulator,
            start_nominal(problem),
            lambda _, cost: curve.append((simulator.steps, cost)),
            Journal(folder, best),
        )
    return solution, best, curve


def kill_after(calls: int, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Let so many simulations pass, then none; the list counts them."""
    count = [0]

    def evaluate(*arguments: Any) -> np.ndarray:
        if count[0] == calls:
            raise Killed
        count[0] += 1
        return cma.evaluate(*arguments)

    monkeypatch.setattr(journal, "evaluate", evaluate)
    return count


@pytest.fixture(scope="module", params=SAMPLERS)
def whole(request: pytest.FixtureRequest, problem: Problem, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A sampler's name, its undisturbed search and the number of its calls."""
    folder = tmp_path_factory.mktemp("whole")
    return request.param, search(problem, request.param, folder), len(list(folder.iterdir()))


def same(one: Any, other: Any) -> bool:
    return (
        one[0].history == other[0].history
        and (one[0].cost, one[0].steps, one[0].status) == (other[0].cost, other[0].steps, other[0].status)
        and np.array_equal(one[0].rollout.q, other[0].rollout.q)
        and np.array_equal(one[1].q, other[1].q)
        and one[2] == other[2]
    )


@settings(max_examples=3, deadline=None, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 0.99))
def test_a_killed_search_goes_on_to_the_same_bits(
    problem: Problem, whole: Any, tmp_path_factory: pytest.TempPathFactory, share: float
) -> None:
    name, undisturbed, calls = whole
    folder, at = tmp_path_factory.mktemp("killed"), int(share * calls)
    with pytest.MonkeyPatch.context() as patch:
        kill_after(at, patch)
        with pytest.raises(Killed):
            search(problem, name, folder)
        count = kill_after(calls, patch)
        assert same(search(problem, name, folder), undisturbed)
        assert count[0] == calls - at


def test_a_damaged_answer_and_one_for_others_are_simulated_anew(
    problem: Problem,
    whole: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    name, undisturbed, calls = whole
    search(problem, name, tmp_path)
    first, *_, last = sorted(tmp_path.glob("*.npz"))
    first.write_bytes(last.read_bytes())
    last.write_bytes(last.read_bytes()[:-20])
    count = kill_after(calls, monkeypatch)
    with caplog.at_level(logging.WARNING):
        assert same(search(problem, name, tmp_path), undisturbed)
    assert last.name in caplog.text
    assert count[0] == 2
    # And both are whole again.
    count = kill_after(0, monkeypatch)
    assert same(search(problem, name, tmp_path), undisturbed)


def test_a_larger_budget_goes_on_with_the_journal(
    problem: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def mppi(budget: int) -> Optimizer:
        options = replace(MPPI, budget=budget)
        return Optimizer(asdict(options), lambda p, s, n, on, ask: annealed_mppi(p, s, n, options, on, ask))

    assert search_mark("a", "mppi", mppi(1_000)) == search_mark("a", "mppi", mppi(2_000))
    assert search_mark("a", "mppi", mppi(1_000)) != search_mark("b", "mppi", mppi(1_000))
    stored: list[dict[str, Any]] = []
    run(mppi(1_000), problem, 1, tmp_path, stored.append)
    done = len(list(tmp_path.iterdir()))
    count = kill_after(100, monkeypatch)
    run(mppi(2_000), problem, 1, tmp_path, stored.append)
    assert 0 < count[0] == len(list(tmp_path.iterdir())) - done
    assert stored[-1]["cost"][: len(stored[0]["cost"])] == stored[0]["cost"]
    assert stored[-1]["seconds"] > stored[0]["seconds"]

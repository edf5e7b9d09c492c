"""The paper's optimiser (section 3.2): CMA-ES on the knots of a spline, 400,000 simulations.

Every sample is one open-loop simulation, so nothing but the cost is asked of the simulator: no
derivatives, no smoothness. Faithful and slow; it is the yardstick for the fast one (`ddp`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking import costs
from physique.tracking.problem import Problem, Solution
from physique.tracking.spline import fit_knots, knot_count, knot_matrix

Array = NDArray[np.float64]

#: E (B,) of open-loop controls (B, N, 50), rad, on a problem.
Objective = Callable[[Problem, Simulator, Array], Array]

#: What a sample that blew up costs: more than any motion, and finite, since CMA subtracts costs.
DIVERGED = 1e12


@dataclass(frozen=True)
class CmaOptions:
    """Settings of the optimiser; the defaults are the paper's.

    samples: simulations an iteration. iterations: at most. sigma: rad, the first standard
    deviation. knots_per_window: spline knots for every 0.4 s.
    warm_start: begin at the spline nearest to the nominal controls instead of at zero.
    """

    samples: int = 200
    iterations: int = 2000
    sigma: float = 0.3
    knots_per_window: int = 6
    seed: int = 0
    warm_start: bool = False

    def __post_init__(self) -> None:
        for name, least in (("samples", 2), ("iterations", 1), ("knots_per_window", 1)):
            if getattr(self, name) < least:
                raise InputError(
                    f"CMA option {name}", str(getattr(self, name)), f"at least {least}", "raise it"
                )
        if not self.sigma > 0:
            raise InputError("CMA option sigma", f"{self.sigma} rad", "more than 0", "try 0.3")


def evaluate(problem: Problem, simulator: Simulator, control: Array) -> Array:
    """E (B,) of open-loop controls (B, N, 50), rad; `DIVERGED` where the simulation blew up."""
    q, v, com, com_velocity, diverged = simulator.run_open_loop(problem.q0, problem.v0, control)
    with np.errstate(over="ignore", invalid="ignore"):
        cost = costs.total(problem.terms(q, v, com, com_velocity))
    bad = diverged | ~np.isfinite(cost) | (cost > DIVERGED)
    return np.where(bad, DIVERGED, cost)


def solve(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: CmaOptions = CmaOptions(),
    on_iteration: Callable[[int, float], None] | None = None,
    objective: Objective = evaluate,
) -> Solution:
    """Minimise E over spline knots, from zero (the T-pose) or from the nominal controls.

    objective: asked for the costs of all samples. `history` holds the lowest E so far. The same
    options give the same result, bit for bit, on any number of threads.
    """
    before = simulator.steps
    seconds = problem.steps * float(problem.character.model.opt.timestep)
    matrix = knot_matrix(knot_count(seconds, options.knots_per_window), problem.steps)
    joints = problem.character.model.nu
    start = np.zeros((matrix.shape[1], joints))
    if options.warm_start:
        start = fit_knots(matrix, nominal.control)
    rng = np.random.default_rng(options.seed)
    search = new_search(start.ravel(), options.sigma, options.samples, rng)
    best, lowest = start, objective(problem, simulator, _controls(matrix, start[None]))[0]
    history = [lowest]
    status = "iterations"
    for iteration in range(1, options.iterations + 1):
        samples = search.ask()
        knots = np.reshape(samples, (len(samples), *start.shape))
        cost = objective(problem, simulator, _controls(matrix, knots))
        search.tell(samples, cost.tolist())
        first = int(np.argmin(cost))
        if cost[first] < lowest:
            best, lowest = knots[first].copy(), cost[first]
        history.append(lowest)
        if on_iteration is not None:
            on_iteration(iteration, float(lowest))
        if stop := search.stop():
            status = "converged: " + ", ".join(sorted(stop))
            break
    return sampled_solution(problem, simulator, matrix @ best, history, before, status)


def sampled_solution(
    problem: Problem, simulator: Simulator, control: Array, history: list[float], before: int, status: str
) -> Solution:
    """The best controls (N, 50) of a search, run once more for the states.

    history: lowest E so far, `DIVERGED` while every sample was. before: `simulator.steps` at the
    search's start.
    """
    rollout = simulator.run(problem.q0, problem.v0, problem.steps, [lambda t, q, v: control[t]])[0]
    return Solution(
        rollout=rollout,
        cost=problem.cost(rollout),
        history=tuple(float(c) if c < DIVERGED else float("inf") for c in history),
        steps=simulator.steps - before,
        status="every sample diverged" if history[-1] >= DIVERGED else status,
    )


def _package() -> ModuleType:
    """The package cma, without its complaint about plots that it cannot draw.

    It brings 45 MB of plotting along, so it is imported where it is used.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Could not import matplotlib")
        import cma
    return cma


def new_search(start: Array, sigma: float, samples: int, rng: np.random.Generator) -> Any:
    """CMA from start (n,) with a standard deviation of sigma, that stops only where it converged.

    All its draws are of rng.
    """
    settings = {
        "popsize": samples,
        "randn": lambda *shape: rng.standard_normal(shape),
        "seed": np.nan,  # leave NumPy's global generator alone
        "maxiter": np.inf,
        "maxfevals": np.inf,
        "tolstagnation": 0,
        "verbose": -9,
        "verb_log": 0,
        "signals_filename": "",  # else it looks for a file in the working folder every iteration
    }
    return _package().CMAEvolutionStrategy(start, sigma, settings)


def _controls(matrix: Array, knots: Array) -> Array:
    """Controls (B, N, 50) of samples knots (B, knots, 50)."""
    return np.einsum("tk,bkj->btj", matrix, knots)

"""Two rivals' samplers, written anew on our `Problem`, so that E can be compared step for step.

`incremental_cem` follows DynaRetarget (arXiv 2602.06827): the cross-entropy method over spline
knots, on a horizon that grows knot by knot. `annealed_mppi` follows SPIDER (arXiv 2511.09484):
softmax-weighted samples about the current controls, with noise that shrinks from iteration to
iteration. Numbers of samples, elite fractions, spacing of the knots, iterations a round and rate
of annealing are as published; all else is ours, and the options' docstrings say which and why.
Neither is its authors' code, and neither has the rest of their pipelines (contact guidance,
receding windows, domain randomisation): it is their sampler that is measured, on our cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking.cma import DIVERGED, Objective, evaluate, sampled_solution
from physique.tracking.problem import Problem, Solution
from physique.tracking.spline import DEGREE, fit_knots, knot_matrix

Array = NDArray[np.float64]

OnIteration = Callable[[int, float], None]

#: Simulations at a time: bounds the memory; a sample's result does not depend on its neighbours.
CHUNK = 256


def _check(
    name: str, options: object, least: dict[str, int], positive: tuple[str, ...], fractions: tuple[str, ...]
) -> None:
    """Raise InputError for an option that makes no sense."""
    for option, value in least.items():
        if getattr(options, option) < value:
            raise InputError(
                f"{name} option {option}", str(getattr(options, option)), f"at least {value}", "raise it"
            )
    for option in positive:
        if not 0 < getattr(options, option) < np.inf:
            raise InputError(
                f"{name} option {option}",
                str(getattr(options, option)),
                "more than 0",
                "leave it at its default",
            )
    for option in fractions:
        if not 0 < getattr(options, option) <= 1:
            raise InputError(
                f"{name} option {option}",
                str(getattr(options, option)),
                "more than 0, at most 1",
                "leave it at its default",
            )


@dataclass(frozen=True)
class CemOptions:
    """Settings of `incremental_cem`.

    As published: samples an iteration; elite, the fraction of them that is kept; spacing of the
    knots, s.

    Ours: sigma, rad, the first standard deviation of every knot; sigma_floor, rad, its least;
    stage_iterations, at most so many before the horizon grows; tolerance, it also grows when
    `patience` iterations together lower the cost by less than this fraction. Half the size
    (512 samples, 0.3 M steps, the walk of `compare_optimizers`) gave E 33 with sigma 0.05, 28
    with 0.1, 42 with 0.3; after 0.4 M steps 18 with a floor of 0.01 and 23 with 0.03.
    budget: simulated steps, never exceeded; the whole window is sampled until they are used up.
    """

    samples: int = 1024
    elite: float = 0.04
    spacing: float = 0.25
    sigma: float = 0.1
    sigma_floor: float = 0.01
    stage_iterations: int = 8
    tolerance: float = 0.02
    patience: int = 3
    budget: int = 3_240_000
    seed: int = 0

    def __post_init__(self) -> None:
        _check(
            "CEM",
            self,
            least={"samples": 2, "stage_iterations": 1, "patience": 1, "budget": 1},
            positive=("spacing", "sigma", "sigma_floor"),
            fractions=("elite",),
        )
        if self.tolerance < 0:
            raise InputError("CEM option tolerance", str(self.tolerance), "0 or more", "try 0.02")


@dataclass(frozen=True)
class MppiOptions:
    """Settings of `annealed_mppi`.

    As published: samples an iteration; elite, the fraction of them that is averaged; spacing of
    the knots of the noise, s; iterations a round; annealing, the factor of the noise over a whole
    round, so that an iteration's is annealing^(1 / iterations).

    Ours: sigma, rad, the noise of a round's first iteration; temperature of the softmax, in
    standard deviations of the elite's cost. A quarter of the size (512 samples, 0.3 M steps, the
    walk of `compare_optimizers`) gave, at temperature 0.3, E 20 with sigma 0.05, 28 with 0.1, 136
    with 0.3; and with sigma 0.05, E 26 at temperature 0.1, 13 at 1, 15 at 3. A narrower average
    throws most of the elite away.
    budget: simulated steps, never exceeded; rounds follow each other until they are used up. The
    default ends early in the second: an iteration on 0.8 s is 0.17 M steps.
    """

    samples: int = 2048
    elite: float = 0.1
    spacing: float = 0.1
    iterations: int = 16
    annealing: float = 0.1
    sigma: float = 0.05
    temperature: float = 1.0
    budget: int = 3_240_000
    seed: int = 0

    def __post_init__(self) -> None:
        _check(
            "MPPI",
            self,
            least={"samples": 2, "iterations": 1, "budget": 1},
            positive=("spacing", "sigma", "temperature"),
            fractions=("elite", "annealing"),
        )


def incremental_cem(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: CemOptions = CemOptions(),
    on_iteration: OnIteration | None = None,
    objective: Objective = evaluate,
) -> Solution:
    """Minimise E over spline knots of the position targets, on a horizon that grows knot by knot.

    Starts at the spline nearest to the nominal controls. A stage samples the knots that move the
    frames so far and minimises E of Eq. 2 over these frames; mean and standard deviation of each
    knot and joint are refitted from the elite, and the next stage goes on with them. `history`
    holds the lowest E of the whole window, for which the best sample of every iteration is run
    to the end. The same options give the same result on any number of threads.
    """
    matrix, mean = _spline(problem, nominal, options.spacing)
    sigma = np.full(mean.shape, options.sigma)
    rng = np.random.default_rng(options.seed)
    best = _Best(problem, simulator, options.budget, on_iteration, objective, matrix @ mean)
    count = max(1, round(options.elite * options.samples))
    for steps in _stages(problem, options.spacing):
        part = problem.beginning(steps)
        whole = steps == problem.steps
        moving = np.any(matrix[:steps] > 0, axis=0)
        lows: list[float] = []
        while best.affords(options.samples * (steps + 1) + (0 if whole else problem.steps + 1)):
            noise = rng.standard_normal((options.samples, int(moving.sum()), mean.shape[1]))
            noise[0] = 0  # the mean itself: it is often better than all that surrounds it
            knots = np.repeat(mean[None], options.samples, axis=0)
            knots[:, moving] += sigma[moving] * noise
            cost = _evaluate(objective, part, simulator, matrix[:steps], knots)
            elite = _elite(cost, count)
            lows.append(float(cost.min()))
            if len(elite):
                mean = knots[elite].mean(axis=0)
                sigma[moving] = np.maximum(knots[elite].std(axis=0)[moving], options.sigma_floor)
            else:
                sigma[moving] /= 2
            first = int(np.argmin(cost))
            best.offer(matrix @ knots[first], float(cost[first]) if whole else None)
            if not whole and _settled(lows, options):
                break
    return best.solution("budget")


def annealed_mppi(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: MppiOptions = MppiOptions(),
    on_iteration: OnIteration | None = None,
    objective: Objective = evaluate,
) -> Solution:
    """Minimise E by averaging noisy controls, with ever less noise; the problem is the horizon.

    Starts at the nominal controls. The noise is a spline, added to controls that need not be one.
    A round anneals; the next one starts with the first noise again, from the best sample so far.
    `history` holds the lowest E so far. The same options give the same result on any number of
    threads.
    """
    matrix, _ = _spline(problem, nominal, options.spacing)
    rng = np.random.default_rng(options.seed)
    best = _Best(problem, simulator, options.budget, on_iteration, objective, nominal.control)
    center = best.control
    count = max(1, round(options.elite * options.samples))
    iteration = 0
    while best.affords(options.samples * (problem.steps + 1)):
        age = iteration % options.iterations
        if age == 0:
            center = best.control
        sigma = options.sigma * options.annealing ** (age / options.iterations)
        noise = sigma * rng.standard_normal((options.samples, matrix.shape[1], center.shape[1]))
        noise[0] = 0  # the average itself
        cost = _evaluate(objective, problem, simulator, matrix, noise, center)
        first = int(np.argmin(cost))
        best.offer(center + matrix @ noise[first], float(cost[first]))
        elite = _elite(cost, count)
        if len(elite):
            scale = options.temperature * max(float(cost[elite].std()), 1e-12)
            weight = np.exp(-(cost[elite] - cost[elite].min()) / scale)
            average = np.einsum("b,bkj->kj", weight / weight.sum(), noise[elite])
            center = center + matrix @ average
        iteration += 1
    return best.solution("budget")


class _Best:
    """The best controls over the whole window so far, and what they cost."""

    def __init__(
        self,
        problem: Problem,
        simulator: Simulator,
        budget: int,
        on_iteration: OnIteration | None,
        objective: Objective,
        start: Array,
    ) -> None:
        self._problem, self._simulator = problem, simulator
        self._before, self._budget = simulator.steps, budget
        self._on_iteration, self._objective = on_iteration, objective
        self.control = start  # (N, 50)
        self.lowest = float(objective(problem, simulator, start[None])[0])
        self.history = [self.lowest]

    def affords(self, steps: int) -> bool:
        """Whether so many steps, and the last run of the result, stay within the budget."""
        used = self._simulator.steps - self._before
        return used + steps + self._problem.steps <= self._budget

    def offer(self, control: Array, cost: float | None) -> None:
        """Keep controls (N, 50) if they are the best; None: run them to know their cost."""
        if cost is None:
            cost = float(self._objective(self._problem, self._simulator, control[None])[0])
        if cost < self.lowest:
            self.control, self.lowest = control, cost
        self.history.append(self.lowest)
        if self._on_iteration is not None:
            self._on_iteration(len(self.history) - 1, self.lowest)

    def solution(self, status: str) -> Solution:
        """The best controls, run once more for the states."""
        return sampled_solution(
            self._problem, self._simulator, self.control, self.history, self._before, status
        )


def _spline(problem: Problem, nominal: Rollout, spacing: float) -> tuple[Array, Array]:
    """The matrix (N, knots) of a spline with this spacing, s, and the knots (knots, 50) nearest
    to the nominal controls.

    The last interval may reach beyond the window; there the last control is held, else the fit
    of its knots would rest on a few steps.
    """
    every = _every(problem, spacing)
    intervals = -(-problem.steps // every)
    matrix = knot_matrix(intervals + DEGREE, intervals * every)
    beyond = intervals * every - problem.steps
    held = np.concatenate([nominal.control, np.repeat(nominal.control[-1:], beyond, axis=0)])
    return matrix[: problem.steps], fit_knots(matrix, held)


def _every(problem: Problem, spacing: float) -> int:
    """Steps between knots, not fewer than a lone interval needs for its four."""
    return max(DEGREE + 1, round(spacing / float(problem.character.model.opt.timestep)))


def _stages(problem: Problem, spacing: float) -> list[int]:
    """Where the horizon ends, in steps: after each interval, at last with the window."""
    every = _every(problem, spacing)
    return [*range(every, problem.steps, every), problem.steps]


def _evaluate(
    objective: Objective,
    problem: Problem,
    simulator: Simulator,
    matrix: Array,
    knots: Array,
    about: Array | float = 0.0,
) -> Array:
    """E (B,) of the splines knots (B, knots, 50) on top of the controls `about` (N, 50)."""
    return np.concatenate(
        [
            objective(problem, simulator, about + np.einsum("tk,bkj->btj", matrix, knots[i : i + CHUNK]))
            for i in range(0, len(knots), CHUNK)
        ]
    )


def _elite(cost: Array, count: int) -> NDArray[np.intp]:
    """Indices of the `count` cheapest samples, without those that blew up."""
    order = np.argsort(cost, kind="stable")[:count]
    return order[cost[order] < DIVERGED]


def _settled(lows: list[float], options: CemOptions) -> bool:
    """Whether a stage has had its iterations, or its last ones were of little use."""
    if len(lows) >= options.stage_iterations:
        return True
    if len(lows) <= options.patience:
        return False
    before = min(lows[: -options.patience])
    return min(lows) > (1 - options.tolerance) * before

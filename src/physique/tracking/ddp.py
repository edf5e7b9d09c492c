"""The fast optimiser: iterative LQR (Gauss-Newton DDP) on the position targets.

Each iteration linearises the simulator along the current motion, solves the linear-quadratic
problem backwards in time, and runs the resulting feedback policy forwards in closed loop at
several step lengths. Torque limits are box limits of each step's quadratic program (`box`); in a
roll-out a target beyond the limit is moved back to it.

Where the body cannot follow well, E has many valleys (a heavy man's step ends at 3 to 58, by how
boldly the search begins), so hard windows are searched more than once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.derivatives.linearize import Linearization
from physique.simulation.linear_feedback import Feedback
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking import costs
from physique.tracking.backward import LinearPolicy, backward
from physique.tracking.costs import Quadratic
from physique.tracking.problem import Problem, Solution

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DdpOptions:
    """Settings of the optimiser.

    iterations: at most. tolerance: stop when the model promises less than this fraction of E, or of
        `enough` where E is below it: easy windows need not be perfect, hard ones get the time.
    kink: rad, where Eq. 7's model is rounded off; first_kink: while the gaps of the nominal motion
        are closed. An orientation held tightly from the start leaves a motion that is far off no
        way to get nearer (E 6.3 instead of 0.6 on a window of the walk).
    step_lengths: of the line search, in pairs.
    damping: of the controls, at the start, its least and its greatest value; start_dampings are
        tried side by side to close the gaps of the nominal motion.
    hard: where the first search ends at a larger E, there are `restarts`: (damping, first_kink) of
        one search each, from the same nominal motion; the damping closes the gaps too.
    """

    iterations: int = 14
    tolerance: float = 0.1
    enough: float = 2.0
    kink: float = 0.01
    first_kink: float = 0.3
    step_lengths: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)
    damping: float = 3.0
    start_dampings: tuple[float, ...] = (1.0, 10.0)
    damping_least: float = 1e-5
    damping_most: float = 1e4
    hard: float = 20.0
    restarts: tuple[tuple[float, float], ...] = ((30.0, 0.3), (0.3, 1.0))


def solve(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: DdpOptions = DdpOptions(),
    on_iteration: Callable[[int, float], None] | None = None,
) -> Solution:
    """Minimise E, starting from the nominal motion, which need not obey physics.

    Where a step from a nominal state misses the next one (a gap), the first backward pass takes
    the gap into account and the first forward pass closes it: started at the reference itself,
    this is LQR tracking of the reference, which stands where open-loop controls fall.

    Of several searches the best is returned, with the steps of all. on_iteration: their number,
    counted on, and the lowest E so far.
    """
    before = simulator.steps
    iterations, lowest = 0, np.inf

    def tell(_: int, cost: float) -> None:
        nonlocal iterations, lowest
        iterations, lowest = iterations + 1, min(lowest, cost)
        if on_iteration is not None:
            on_iteration(iterations, lowest)

    best = _search(problem, simulator, nominal, options, tell)
    if best.cost > options.hard:
        for damping, kink in options.restarts:
            other = replace(options, damping=damping, start_dampings=(damping,), first_kink=kink)
            best = min(best, _search(problem, simulator, nominal, other, tell), key=_cost)
    return replace(best, steps=simulator.steps - before)


def _cost(solution: Solution) -> float:
    return solution.cost


def _search(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: DdpOptions,
    on_iteration: Callable[[int, float], None],
) -> Solution:
    """From one damping to the bottom of one valley."""
    before = simulator.steps
    history: list[float] = []
    about_nominal = _expand(problem, simulator, nominal, None, options.first_kink)
    best, cost = _close_gaps(problem, simulator, nominal, about_nominal, options)
    history.append(cost)
    if not np.isfinite(cost):
        return Solution(best, cost, tuple(history), simulator.steps - before, "start diverged")
    derivatives: tuple[Linearization, Quadratic] | None = None
    damping = options.damping
    status = "iterations"
    for iteration in range(1, options.iterations):
        if derivatives is None:
            derivatives = _expand(problem, simulator, best, best.v[1:], options.kink)
        policy = backward(problem, best, *derivatives, damping)
        found = None
        if policy is not None:
            least = options.tolerance * max(cost, options.enough)
            if policy.gain < least and damping <= options.damping:
                status = "converged"
                break
            found = _line_search(problem, simulator, best, cost, policy, options.step_lengths)
        if found is None:
            damping *= 8
            if damping > options.damping_most:
                status = "no step lowers the cost"
                break
            continue
        best, cost, length = found
        derivatives = None
        history.append(cost)
        on_iteration(iteration, cost)
        damping = _adapt(damping, length, options)
    return Solution(best, cost, tuple(history), simulator.steps - before, status)


def _adapt(damping: float, length: float, options: DdpOptions) -> float:
    """Short steps mean that the linear model was trusted too far."""
    factor = 1 / 4 if length == 1.0 else 1.0 if length == 0.5 else 4.0
    return float(np.clip(damping * factor, options.damping_least, options.damping_most))


def _close_gaps(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    derivatives: tuple[Linearization, Quadratic],
    options: DdpOptions,
) -> tuple[Rollout, float]:
    """The best roll-out about the nominal motion, with feedback or without."""
    controllers = [
        closed_loop(problem, nominal, policy, length)
        for damping in options.start_dampings
        if (policy := backward(problem, nominal, *derivatives, damping)) is not None
        for length in (1.0, 0.0)
    ]
    no_gain = np.zeros((*nominal.control.shape, 2 * nominal.v.shape[1]))
    controllers.append(Feedback(problem.character, nominal.q, nominal.v, nominal.control, no_gain))
    rollouts = simulator.run(problem.q0, problem.v0, problem.steps, controllers)
    best = min(rollouts, key=problem.cost)
    return best, problem.cost(best)


def _expand(
    problem: Problem, simulator: Simulator, rollout: Rollout, v_next: Array | None, kink: float
) -> tuple[Linearization, Quadratic]:
    linear = simulator.linearize(rollout.q[:-1], rollout.v[:-1], rollout.control, v_next)
    jacobian = kinematics.com_jacobian(problem.character, rollout.q)
    quadratic = costs.expand(
        problem.weights,
        problem.target,
        rollout.q,
        rollout.v,
        rollout.com,
        rollout.com_velocity,
        jacobian,
        kink,
    )
    return linear, quadratic


def _line_search(
    problem: Problem,
    simulator: Simulator,
    best: Rollout,
    cost: float,
    policy: LinearPolicy,
    lengths: tuple[float, ...],
) -> tuple[Rollout, float, float] | None:
    """The first pair of step lengths of which one lowers E, and the better of the two."""
    for i in range(0, len(lengths), 2):
        pair = lengths[i : i + 2]
        rollouts = simulator.run(
            problem.q0,
            problem.v0,
            problem.steps,
            [closed_loop(problem, best, policy, length) for length in pair],
        )
        found = [(problem.cost(r), -length, r) for r, length in zip(rollouts, pair)]
        low, minus_length, rollout = min(found, key=lambda f: f[:2])
        if low < cost:
            return rollout, low, -minus_length
    return None


def closed_loop(problem: Problem, about: Rollout, policy: LinearPolicy, length: float) -> Feedback:
    """The controller that follows `policy` with its feedforward scaled by `length`."""
    return Feedback(
        problem.character, about.q, about.v, about.control + length * policy.feedforward, policy.feedback
    )

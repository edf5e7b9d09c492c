"""The fast optimiser: iterative LQR (Gauss-Newton DDP) on the position targets.

Each iteration linearises the simulator along the current motion, solves the linear-quadratic
problem backwards in time, and runs the resulting feedback policy forwards in closed loop at
several step lengths. Torque limits are box limits of each step's quadratic program (`box`); in a
roll-out a target beyond the limit is moved back to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrs

from physique.simulation import kinematics
from physique.simulation.linearize import Linearization
from physique.simulation.rollout import Feedback, Rollout, usable_limit
from physique.simulation.simulator import Simulator
from physique.simulation.state import difference
from physique.tracking import costs
from physique.tracking.box import solve_box
from physique.tracking.costs import Quadratic
from physique.tracking.problem import Problem, Solution

Array = NDArray[np.float64]


#: Joints of this strength are damped by just `Options.damping`.
DAMPING_LIMIT = 100.0  # Nm


@dataclass(frozen=True)
class Options:
    """Settings of the optimiser.

    iterations: at most. tolerance: stop when the model promises less than this fraction of E.
    kink: rad, where Eq. 7's model is rounded off; first_kink: while the gaps of the nominal motion
        are closed. An orientation held tightly from the start leaves a motion that is far off no
        way to get nearer (E 6.3 instead of 0.6 on a window of the walk).
    step_lengths: of the line search, in pairs.
    damping: of the controls, at the start, its least and its greatest value; start_dampings are
        tried side by side to close the gaps of the nominal motion.
    """

    iterations: int = 20
    tolerance: float = 0.02
    kink: float = 0.01
    first_kink: float = 0.3
    step_lengths: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)
    damping: float = 3.0
    start_dampings: tuple[float, ...] = (1.0, 10.0)
    damping_least: float = 1e-5
    damping_most: float = 1e4


@dataclass(frozen=True)
class Policy:
    """u(t, x) = control + step * feedforward + feedback (x - x0); (N, 50), (N, 50), (N, 50, 112).

    gain: the decrease of E that the model predicts for a full step.
    """

    feedforward: Array
    feedback: Array
    gain: float


def solve(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    options: Options = Options(),
    on_iteration: Callable[[int, float], None] | None = None,
) -> Solution:
    """Minimise E, starting from the nominal motion, which need not obey physics.

    Where a step from a nominal state misses the next one (a gap), the first backward pass takes
    the gap into account and the first forward pass closes it: started at the reference itself,
    this is LQR tracking of the reference, which stands where open-loop controls fall.
    """
    before = simulator.steps
    history: list[float] = []
    about_nominal = _expand(problem, simulator, nominal, options.first_kink)
    best, cost = _close_gaps(problem, simulator, nominal, about_nominal, options)
    history.append(cost)
    if not np.isfinite(cost):
        return Solution(best, cost, tuple(history), simulator.steps - before, "start diverged")
    derivatives: tuple[Linearization, Quadratic] | None = None
    damping = options.damping
    status = "iterations"
    for iteration in range(1, options.iterations):
        if derivatives is None:
            derivatives = _expand(problem, simulator, best, options.kink)
        policy = backward(problem, best, *derivatives, damping)
        found = None
        if policy is not None:
            if policy.gain < options.tolerance * cost and damping <= options.damping:
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
        if on_iteration is not None:
            on_iteration(iteration, cost)
        damping = _adapt(damping, length, options)
    return Solution(best, cost, tuple(history), simulator.steps - before, status)


def _adapt(damping: float, length: float, options: Options) -> float:
    """Short steps mean that the linear model was trusted too far."""
    factor = 1 / 4 if length == 1.0 else 1.0 if length == 0.5 else 4.0
    return float(np.clip(damping * factor, options.damping_least, options.damping_most))


def _close_gaps(
    problem: Problem,
    simulator: Simulator,
    nominal: Rollout,
    derivatives: tuple[Linearization, Quadratic],
    options: Options,
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
    problem: Problem, simulator: Simulator, rollout: Rollout, kink: float
) -> tuple[Linearization, Quadratic]:
    linear = simulator.linearize(rollout.q[:-1], rollout.v[:-1], rollout.control)
    jacobian = kinematics.com_jacobian(problem.character, rollout.q)
    quadratic = costs.expand(
        problem.weights, problem.target, rollout.q, rollout.v, rollout.com, rollout.com_velocity,
        jacobian, kink,
    )  # fmt: skip
    return linear, quadratic


def backward(
    problem: Problem, rollout: Rollout, linear: Linearization, cost: Quadratic, damping: float
) -> Policy | None:
    """The linear-quadratic policy about a roll-out; None where the damping is too small.

    A step moves the state through its new velocity alone, v' = v + a dx + b du, and q' follows
    from v' (`Linearization`); with G = dx'/dv' the value of the next state reaches this one as
    G^T V G (56, 56), which halves the work.
    """
    steps, nu = rollout.control.shape
    nv = rollout.v.shape[1]
    feedforward, feedback = np.zeros((steps, nu)), np.zeros((steps, nu, 2 * nv))
    v_x, v_xx = cost.gradient[-1].copy(), cost.hessian[-1].copy()
    # Zero, but for a nominal motion that does not obey physics.
    gaps = np.concatenate(
        [difference(rollout.q[1:], linear.q), linear.v - rollout.v[1:]], axis=1
    )  # (N, 112)
    gain = 0.0
    character = problem.character
    kp, lag = character.stiffness, character.damping / character.stiffness
    limit = usable_limit(character)
    low, high = (-limit - rollout.torque) / kp, (limit - rollout.torque) / kp
    # The same change of target uses more of a weak joint's strength.
    weight = damping * DAMPING_LIMIT / character.torque_limit
    joint = np.arange(nu)
    # A joint at its limit keeps its torque, so its target moves along with the joint.
    along = np.zeros((nu, 2 * nv))
    left, right = np.empty((2, nv + nu, 2 * nv))
    mixed = np.empty((nu, 2 * nv))
    along[joint, 6 + joint], along[joint, nv + 6 + joint] = 1.0, lag
    for t in range(steps - 1, -1, -1):
        a, b = linear.by_state[t], linear.by_control[t]
        v_x += v_xx @ gaps[t]
        value = linear.pull_back(t, v_xx, v_x)
        left[:nv] = a
        half = np.matmul(value.vv, a, out=right[:nv])
        half *= 0.5
        half[:, :nv] += value.vq
        q_x = a.T @ value.by_v
        q_x += cost.gradient[t]
        q_x[:nv] += value.by_q
        q_u = b.T @ value.by_v
        b_value = b.T @ value.vv
        q_uu = b_value @ b
        q_ux = np.matmul(b_value, a, out=mixed)
        q_ux[:, :nv] += b.T @ value.vq
        regular = q_uu.copy()
        regular.flat[:: nu + 1] += weight
        found = solve_box(regular, q_u, low[t], high[t])
        if found is None:
            return None
        k, free, factor = found
        K = feedback[t]
        if free.all():
            K[:] = -_solve(factor, q_ux)
        else:
            K[:] = along
            if free.any():
                held = q_ux[free] + regular[np.ix_(free, ~free)] @ along[~free]
                K[free] = -_solve(factor, held)
        feedforward[t] = k
        uu_k = q_uu @ k
        gain -= float(q_u @ k + 0.5 * k @ uu_k)
        v_x = q_x + K.T @ (q_u + uu_k) + q_ux.T @ k
        # a^T vv a + a^T [vq 0] + K^T q_uu K / 2 + K^T q_ux, and its transpose.
        left[nv:] = K
        rest = np.matmul(q_uu, K, out=right[nv:])
        rest *= 0.5
        rest += q_ux
        v_xx = left.T @ right
        v_xx += v_xx.T.copy()
        v_xx += cost.hessian[t]
        v_xx[:nv, :nv] += value.qq
    return Policy(feedforward, feedback, gain)


def _solve(factor: Array, right: Array) -> Array:
    """H^-1 right, of the lower Cholesky factor of H."""
    # LAPACK wants columns; converting in its wrapper is ten times slower.
    solved: Array = dpotrs(factor, np.asfortranarray(right), lower=1, overwrite_b=1)[0]
    return solved


def _line_search(
    problem: Problem,
    simulator: Simulator,
    best: Rollout,
    cost: float,
    policy: Policy,
    lengths: tuple[float, ...],
) -> tuple[Rollout, float, float] | None:
    """The first pair of step lengths of which one lowers E, and the better of the two."""
    for i in range(0, len(lengths), 2):
        pair = lengths[i : i + 2]
        rollouts = simulator.run(
            problem.q0, problem.v0, problem.steps,
            [closed_loop(problem, best, policy, length) for length in pair],
        )  # fmt: skip
        found = [(problem.cost(r), -length, r) for r, length in zip(rollouts, pair)]
        low, minus_length, rollout = min(found, key=lambda f: f[:2])
        if low < cost:
            return rollout, low, -minus_length
    return None


def closed_loop(problem: Problem, about: Rollout, policy: Policy, length: float) -> Feedback:
    """The controller that follows `policy` with its feedforward scaled by `length`."""
    return Feedback(
        problem.character, about.q, about.v,
        about.control + length * policy.feedforward, policy.feedback,
    )  # fmt: skip

"""From a perturbed state back to the tree as published: CMA on a few knots of N steps (4.2).

A sample is N = 20 steps of open-loop control on 3 knots, then the LQR controllers from a nearby
node on; L of Eq. 21 of what follows is its cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.feedback.choice import ZETA, along, distance, features
from physique.feedback.connect import Trunk, make_branch
from physique.feedback.law import BOUND, path
from physique.feedback.tree import Branch, Tree
from physique.simulation.linear_feedback import Feedback
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking.cma import new_search
from physique.tracking.spline import DEGREE, fit_knots, knot_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CmaConnectOptions:
    """steps: N; knots: of a spline over them. samples, iterations, sigma (rad): of CMA. ahead:
    steps that are rolled out after N (the paper's shortened objective). alpha: frames that the node
    may be off in time. zeta: L at which it is good enough."""

    steps: int = 20
    knots: int = 3
    samples: int = 40
    iterations: int = 40
    sigma: float = 0.2
    ahead: int = 110
    alpha: int = 25
    zeta: float = ZETA


def connect(
    simulator: Simulator,
    trunk: Trunk,
    tree: Tree,
    q: Array,
    v: Array,
    frame: int,
    rng: np.random.Generator,
    options: CmaConnectOptions = CmaConnectOptions(),
) -> Branch | None:
    """A branch of N steps from the state q (57,), v (56,) at `frame`; None where L stays above
    zeta."""
    steps = options.steps
    if frame + steps >= trunk.last:
        return None
    goal = _goal(simulator, tree, q, v, frame, options)
    way = path(tree, goal, min(options.ahead, trunk.last - frame - steps))
    about_q, about_v = tree.q[way.nodes].copy(), tree.v[way.nodes]
    about_q[:, :2] += way.shift
    lead = np.zeros((steps, 50, 112))
    follow_gains = tree.gains[tree.gain[way.nodes]].astype(np.float64)
    follow_control = tree.control[way.nodes]
    matrix = knot_matrix(options.knots, steps, min(DEGREE, options.knots - 1))
    guess = tree.control[np.minimum(frame + np.arange(steps), trunk.last)]
    start = fit_knots(matrix, guess)

    def controller(knots: Array) -> Feedback:
        return Feedback(
            simulator.character,
            np.concatenate([np.repeat(q[None], steps, axis=0), about_q]),
            np.concatenate([np.repeat(v[None], steps, axis=0), about_v]),
            np.concatenate([matrix @ knots, follow_control]),
            np.concatenate([lead, follow_gains]),
            BOUND,
        )

    def loss(motion: Rollout) -> float:
        if motion.diverged:
            return 1e6
        count = len(motion.control)
        frames = np.minimum(frame + np.arange(count + 1), trunk.last)
        far = distance(tree, frames, motion.q, motion.com, motion.com_velocity)[steps:]
        value = along(far)
        return float(value) if np.isfinite(value) else 1e6

    search = new_search(start.ravel(), options.sigma, options.samples, rng)
    best, found = np.inf, None
    for _ in range(options.iterations):
        samples = search.ask()
        motions = simulator.run(
            q, v, steps + len(way.nodes), [controller(s.reshape(start.shape)) for s in samples]
        )
        costs = [loss(motion) for motion in motions]
        search.tell(samples, costs)
        if min(costs) < best:
            best, found = min(costs), motions[int(np.argmin(costs))]
        if best < options.zeta:
            assert found is not None
            return make_branch(
                simulator,
                trunk,
                found.q[: steps + 1],
                found.v[: steps + 1],
                found.control[:steps],
                frame,
                np.zeros(2),
                parent=goal,
            )
    return None


def _goal(
    simulator: Simulator, tree: Tree, q: Array, v: Array, frame: int, options: CmaConnectOptions
) -> int:
    """The nearest node to a state that is N steps later in time, within alpha."""
    pose = kinematics.poses(simulator.character, q[None])
    velocity = kinematics.com_velocity(pose.com_jacobian, v[None])
    here = features(q[None], v[None], pose.com, velocity)
    near = np.flatnonzero(np.abs(tree.frame - frame - options.steps) <= options.alpha)
    there = features(tree.q[near], tree.v[near], tree.com[near], tree.com_velocity[near])
    return int(near[np.argmin(np.sum((there - here) ** 2, axis=1))])

"""The receding pair of windows (section 3.2): optimise a stretch ahead, keep its beginning.

Each window starts where the simulation stands; the reference is moved horizontally so that its
centre of mass starts above the character's. The controls that are kept are replayed once, from
the very state the window started in, so that the trajectory is one unbroken simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.model import Character
from physique.reference.reference import Reference
from physique.reference.target import Weights
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking.problem import Problem, Solution, warm_start

Array = NDArray[np.float64]

#: Minimises the problem's E from a nominal motion (which need not obey physics).
Optimizer = Callable[[Problem, Simulator, Rollout], Solution]


@dataclass(frozen=True)
class Schedule:
    """horizon: s that each window looks ahead. commit: s of it that are kept, or `careful` where E
    of the window exceeds `hard`: where the body cannot follow, what is best changes as soon as more
    of the future is seen."""

    horizon: float = 0.8
    commit: float = 0.3
    careful: float = 0.15
    hard: float = 20.0

    def kept(self, cost: float) -> float:
        """s that are kept of a window with this E."""
        return min(self.commit, self.careful) if cost > self.hard else self.commit


@dataclass(frozen=True)
class Window:
    """A finished window: frames start to stop of the motion, n = stop - start.

    q (n + 1, 57), v (n + 1, 56): the kept states, the first is the one it started in. control,
    torque (n, 50). shift (2,) m: how the reference was moved. tail_*: the optimised motion after
    `stop`, where the next window begins its search. cost: E of the whole horizon, by term.
    """

    start: int
    stop: int
    q: Array
    v: Array
    control: Array
    torque: Array
    shift: Array
    tail_q: Array
    tail_v: Array
    tail_control: Array
    terms: dict[str, float]
    cost: float
    iterations: int
    sim_steps: int
    status: str


def track(
    character: Character,
    reference: Reference,
    q0: Array,
    v0: Array,
    simulator: Simulator,
    optimizer: Optimizer,
    schedule: Schedule,
    weights: Weights,
    done: list[Window],
) -> Iterator[Window]:
    """The windows after those in `done`, one by one, from the start state q0 (57,), v0 (56,)."""
    last = reference.frames - 1
    previous = done[-1] if done else None
    start = previous.stop if previous else 0
    while start < last:
        q, v = (previous.q[-1], previous.v[-1]) if previous else (q0, v0)
        previous = _optimize(
            character, reference, q, v, start, previous, simulator, optimizer, schedule, weights
        )
        yield previous
        start = previous.stop


def _optimize(
    character: Character,
    reference: Reference,
    q: Array,
    v: Array,
    start: int,
    previous: Window | None,
    simulator: Simulator,
    optimizer: Optimizer,
    schedule: Schedule,
    weights: Weights,
) -> Window:
    timestep, last = reference.timestep, reference.frames - 1
    end = min(start + round(schedule.horizon / timestep), last)
    com = kinematics.poses(character, q[None], heights=False).com[0]
    shift = com[:2] - reference.com[start, :2]
    target = reference.target(start, end + 1, shift)
    problem = Problem(character, q, v, target, weights)
    planned = (previous.tail_q, previous.tail_v, previous.tail_control) if previous is not None else None
    before = simulator.steps
    solution = optimizer(problem, simulator, warm_start(problem, planned))
    motion = solution.rollout
    keep = round(schedule.kept(solution.cost) / timestep)
    if end == last:  # nothing is left to look at: keep it whole
        keep = end - start
    terms = problem.terms(motion.q, motion.v, motion.com, motion.com_velocity)
    return Window(
        start=start,
        stop=start + keep,
        q=motion.q[: keep + 1],
        v=motion.v[: keep + 1],
        control=motion.control[:keep],
        torque=motion.torque[:keep],
        shift=shift,
        tail_q=motion.q[keep + 1 :],
        tail_v=motion.v[keep + 1 :],
        tail_control=motion.control[keep:],
        terms={name: float(value) for name, value in terms.items()},
        cost=solution.cost,
        iterations=len(solution.history) - 1,
        sim_steps=simulator.steps - before,
        status=solution.status,
    )

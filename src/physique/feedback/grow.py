"""Algorithm 1: push the motion at random, see what fails, lead it back, add that to the tree.

Trials are numbered, and each has random numbers of its own. A round is a few trials against the
same tree; its branches are added in the trials' order. So the tree depends on the seed alone, not
on how many processes work or when they were stopped.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.errors import InputError
from physique.feedback import cma_connect, connect
from physique.feedback.choice import DEFAULT, ZETA, Chooser
from physique.feedback.connect import Trunk
from physique.feedback.law import BOUND, Law
from physique.feedback.pushes import random_pushes
from physique.feedback.tree import Branch, grown, trunk
from physique.simulation.closed_loop import Servo
from physique.simulation.linear_feedback import Feedback
from physique.simulation.simulator import Simulator
from physique.simulation.stepper import Push

Array = NDArray[np.float64]

Connector = Literal["fast", "paper"]

#: Trials that meet the same tree; it must not depend on the number of workers.
ROUND = 8
PUSH = 0.1  # s
#: What else decides a tree, and must be the same for all of it.
METHOD: dict[str, Any] = {
    "round": ROUND,
    "push": PUSH,
    "zeta": ZETA,
    "choice": asdict(DEFAULT),
    "fast": asdict(connect.ConnectOptions()),
    "paper": asdict(cma_connect.CmaConnectOptions()),
}


@dataclass(frozen=True)
class Settings:
    """h, F and Lambda of Algorithm 1, and how.

    interval: s between subtrees. forces: N, the greatest of each turn. trials: of each force at
    each subtree. passes: the second has half the interval, and so on. parts: of
    `skeleton.JOINTS`, that are pushed; all if empty.
    """

    interval: float = 0.1
    forces: tuple[float, ...] = (150.0, 300.0, 500.0)
    trials: int = 8
    seed: int = 0
    connector: Connector = "fast"
    passes: int = 1
    parts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.interval) and 0.01 <= self.interval <= 10.0):
            _refuse("interval", f"{self.interval:g} s", "0.01 to 10 s")
        if not self.forces or not all(math.isfinite(f) and 0 < f <= 1e5 for f in self.forces):
            _refuse("forces", ",".join(f"{f:g}" for f in self.forces) or "none", "positive N")
        if not 1 <= self.trials <= 100_000:
            _refuse("trials", str(self.trials), "1 to 100000")
        if not 0 <= self.seed < 2**32:
            _refuse("seed", str(self.seed), "0 to 4294967295")
        if not 1 <= self.passes <= 8:
            _refuse("passes", str(self.passes), "1 to 8")
        for part in self.parts:
            if part not in skeleton.INDEX:
                _refuse("parts", repr(part), "names of parts: " + ", ".join(skeleton.JOINTS))


@dataclass(frozen=True)
class Round:
    """Trials number first to first + count - 1, at one frame, up to one force, N."""

    index: int
    frame: int
    force: float
    first: int
    count: int

    @property
    def numbers(self) -> range:
        """Of its trials."""
        return range(self.first, self.first + self.count)


@dataclass(frozen=True)
class Attempt:
    """What came of a trial: the tree stood it, or a branch leads it back, or neither.

    steps: that were simulated. cpu: s of processor time.
    """

    covered: bool
    branch: Branch | None
    steps: int
    cpu: float


def plan(settings: Settings, frames: int, timestep: float) -> list[Round]:
    """All rounds, from the motion's end to its beginning, pass by pass (lines 10 to 13)."""
    rounds: list[Round] = []
    trial = 0
    for number in range(settings.passes):
        apart = max(1, round(settings.interval / timestep / 2**number))
        for frame in range(frames - 1 - apart, -1, -apart):
            if number and (frames - 1 - frame) % (2 * apart) == 0:
                continue  # the pass before was there
            for force in settings.forces:
                for start in range(0, settings.trials, ROUND):
                    count = min(ROUND, settings.trials - start)
                    rounds.append(Round(len(rounds), frame, force, trial, count))
                    trial += count
    return rounds


class Grower:
    """Makes trials against a tree; one for each process."""

    def __init__(self, simulator: Simulator, motion: Trunk, settings: Settings) -> None:
        self._simulator, self._motion, self._settings = simulator, motion, settings
        self._servo = Servo(simulator.character.xml)
        self.tree = trunk(motion.q, motion.v, motion.control, motion.com, motion.com_velocity, motion.gains)
        self._law = Feedback(simulator.character, motion.q, motion.v, motion.control, motion.gains, BOUND)
        self.meet([])

    def meet(self, branches: Sequence[Branch], gains: NDArray[np.float16] | None = None) -> None:
        """Let the tree have these branches too; gains: see `grown`."""
        self.tree = grown(self.tree, branches, gains)
        self._chooser = Chooser(Law(self._servo, self.tree), DEFAULT, threads=1)

    def attempt(self, round_: Round, number: int) -> Attempt:
        """Trial `number` (lines 13 to 26)."""
        rng = np.random.default_rng([self._settings.seed, number])
        clock = time.process_time()
        before = self._simulator.steps + self._chooser.steps
        q, v, at = self._perturb(rng, round_)
        covered = True
        branch = None
        # A body that the push itself has thrown off cannot be led back.
        if at < self._motion.last:
            choice = self._chooser.choose(q, v, at)
            covered = choice.loss < ZETA
            if not covered:
                branch = self._connect(q, v, at, rng)
        steps = self._simulator.steps + self._chooser.steps - before
        return Attempt(covered, branch, steps, time.process_time() - clock)

    def _perturb(self, rng: np.random.Generator, round_: Round) -> tuple[Array, Array, int]:
        """x^p: the state after a push of half to all of the force, under the motion's LQR."""
        timestep = self._servo.timestep
        steps = min(round(PUSH / timestep), self._motion.last - round_.frame)
        impulse = round_.force * steps * timestep * rng.uniform(0.5, 1.0)
        parts = [skeleton.INDEX[name] for name in self._settings.parts or skeleton.JOINTS]
        start = round_.frame, round_.frame
        push = random_pushes(rng, 1, impulse, steps, start, timestep, parts)[0]
        moved = self._simulator.perform(
            self._motion.q[push.start],
            self._motion.v[push.start],
            steps,
            lambda t, q, v: self._law(push.start + t, q, v),
            Push(push.part, push.force, 0, steps),
        )
        return moved.q[-1], moved.v[-1], push.start + steps

    def _connect(self, q: Array, v: Array, at: int, rng: np.random.Generator) -> Branch | None:
        if self._settings.connector == "paper":
            return cma_connect.connect(self._simulator, self._motion, self.tree, q, v, at, rng)
        return connect.connect(self._simulator, self._motion, q, v, at)


def _refuse(option: str, found: str, expected: str) -> None:
    raise InputError(f"growth option {option}", found, expected, "correct the value")

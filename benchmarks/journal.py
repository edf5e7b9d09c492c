"""Searches that may be killed: what simulations cost is written down, and read on the way back."""

from __future__ import annotations

import hashlib
import logging
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics
from physique.character.joint_error import joint_errors
from physique.errors import InputError
from physique.simulation.simulator import Simulator
from physique.store import prepare_folder, read_npz, write_npz
from physique.tracking import costs
from physique.tracking.cma import evaluate
from physique.tracking.problem import Problem

Array = NDArray[np.float64]
log = logging.getLogger(__name__)


@dataclass
class Best:
    """The motion of the lowest E that was asked for: q (N + 1, 57)."""

    cost: float = np.inf
    q: Array | None = None


@dataclass(frozen=True)
class Watched(Problem):
    """A problem that remembers the best motion, whichever optimiser asks what motions cost."""

    best: Best = field(default_factory=Best)

    def terms(self, q: Array, v: Array, com: Array, com_velocity: Array) -> dict[str, Array]:
        """As `Problem.terms`."""
        terms = super().terms(q, v, com, com_velocity)
        cost = np.nan_to_num(costs.total(terms), nan=np.inf)
        first = np.unravel_index(np.argmin(cost), cost.shape)
        if cost[first] < self.best.cost:
            self.best.cost, self.best.q = float(cost[first]), q[first].copy()
        return terms

    def beginning(self, steps: int) -> Problem:
        """As `Problem.beginning`; what a shorter motion costs is not watched."""
        whole = Problem(self.character, self.q0, self.v0, self.target, self.weights)
        return self if steps == self.steps else whole.beginning(steps)

    def error(self) -> float:
        """Mean joint error, mm, of the best motion; NaN before there is one."""
        if self.best.q is None:
            return float("nan")
        joints, wanted = (
            kinematics.poses(self.character, q, heights=False).joints for q in (self.best.q, self.target.q)
        )
        return 1e3 * float(joint_errors(joints, wanted).mean())


class Journal:
    """An objective for samplers that stores each answer as a file of the folder.

    A search that was stopped is run again from its beginning, with the stored answers instead of
    simulations as far as they go: to the same bits, in seconds. An answer is used only for the very
    controls that it was given for; one that is damaged or for others is simulated anew.
    """

    def __init__(self, folder: Path, best: Best) -> None:
        self._folder, self._best = prepare_folder(folder), best
        self._calls = 0
        self._spent, self._since = 0.0, time.process_time()

    @property
    def seconds(self) -> float:
        """Of the processor, of all the search so far, that of stopped runs included."""
        return self._spent + time.process_time() - self._since

    def __call__(self, problem: Problem, simulator: Simulator, control: Array) -> Array:
        """`evaluate`, from the journal where it has the answer."""
        path = self._folder / f"{self._calls:05d}.npz"
        asked = hashlib.sha256(np.ascontiguousarray(control).tobytes()).hexdigest()
        answer = _read(path, asked)
        if answer is None:
            before, lowest = simulator.steps, self._best.cost
            cost = evaluate(problem, simulator, control)
            answer = {
                "asked": asked,
                "cost": cost,
                "steps": simulator.steps - before,
                "seconds": self.seconds,
            }
            if self._best.cost < lowest:
                answer |= {"best_cost": self._best.cost, "best_q": self._best.q}
            write_npz(path, answer)
        else:
            simulator.steps += int(answer["steps"])
            self._spent, self._since = float(answer["seconds"]), time.process_time()
            if "best_q" in answer:
                self._best.cost, self._best.q = float(answer["best_cost"]), answer["best_q"]
        self._calls += 1
        return answer["cost"]


def _read(path: Path, asked: str) -> dict[str, Any] | None:
    """The answer that is stored for these controls, if it is whole."""
    if not path.is_file():
        return None
    try:
        answer = read_npz(path)
    except InputError as fault:
        log.warning("%s; simulating this part again", fault)
        return None
    return answer if str(answer["asked"]) == asked else None

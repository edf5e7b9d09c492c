"""What the floor did to the body in a run, by replay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.simulation.stepper import Stepper

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GroundReaction:
    """Of N steps, between frame t and frame t + 1, as in `FloorForces`: feet (N, 2, 3) N,
    pressure (N, 2, 2) m, other (N, 3) N."""

    feet: Array
    pressure: Array
    other: Array

    @property
    def total(self) -> Array:
        """(N, 3) N: all that the floor does."""
        return self.feet.sum(axis=1) + self.other


def ground_reaction(character: Character, q: Array, v: Array, control: Array) -> GroundReaction:
    """Repeat each step from q (N + 1, 57), v (N + 1, 56) under control (N, 50) and read contacts.

    Every step starts from the states given, which are all that a step depends on, so the forces
    are those of the run itself.
    """
    stepper, steps = Stepper(character.model), len(control)
    out = GroundReaction(np.empty((steps, 2, 3)), np.empty((steps, 2, 2)), np.empty((steps, 3)))
    for t in range(steps):
        stepper.start(q[t], v[t])
        stepper.step(control[t])
        out.feet[t], out.pressure[t], out.other[t] = stepper.floor
    return out

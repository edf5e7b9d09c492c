"""What optimisers and controllers ask of a simulator: another back end is one more class that has this."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.derivatives.linearize import Linearization
from physique.simulation.rollout import Controller, Rollout
from physique.simulation.stepper import Observer, Push

Array = NDArray[np.float64]


class OpenLoop(NamedTuple):
    """B roll-outs of N steps: q (B, N + 1, 57), v (B, N + 1, 56), com and com_velocity (B, N + 1, 3);
    diverged (B,): whose states mean nothing."""

    q: Array
    v: Array
    com: Array
    com_velocity: Array
    diverged: NDArray[np.bool_]


class Simulator(Protocol):
    """Simulates one character, and counts every step that it takes in `steps`.

    Results are the same on any number of threads, and in `run` and `run_open_loop` to the same bits.
    """

    character: Character
    steps: int

    def run(self, q: Array, v: Array, steps: int, controllers: Sequence[Controller]) -> list[Rollout]:
        """One roll-out of `steps` steps from (q (57,), v (56,)) for each controller."""

    def run_open_loop(self, q: Array, v: Array, control: Array) -> OpenLoop:
        """Roll-outs from (q (57,), v (56,)) under control (B, N, 50)."""

    def perform(
        self,
        q: Array,
        v: Array,
        steps: int,
        controller: Controller,
        push: Push | None = None,
        observe: Observer | None = None,
    ) -> Rollout:
        """One roll-out that may be pushed and watched; it ends where it blows up or `observe` ends it."""

    def linearize(self, q: Array, v: Array, control: Array, v_next: Array | None = None) -> Linearization:
        """Derivatives of the steps from q (N, 57), v (N, 56) under control (N, 50); v_next (N, 56):
        what they lead to, where it is known."""

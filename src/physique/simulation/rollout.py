"""A stretch of simulation under a controller, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from physique.simulation.stepper import Observer, Push, Stepper

Array = NDArray[np.float64]
M = TypeVar("M")

#: (t, q (57,), v (56,)) -> position targets (50,) of step t.
Controller = Callable[[int, Array, Array], Array]


@dataclass(frozen=True)
class Rollout:
    """States, controls and centres of mass of T frames; `diverged` where the simulation blew up.

    q (T, 57), v (T, 56), control (T - 1, 50) rad, torque (T - 1, 50) Nm, com (T, 3) m,
    com_velocity (T, 3) m/s. After a divergence nothing changes any more.
    """

    q: Array
    v: Array
    control: Array
    torque: Array
    com: Array
    com_velocity: Array
    diverged: bool

    def beginning(self, frames: int) -> Rollout:
        """The first `frames` frames."""
        return beginning(self, frames)


def beginning(motion: M, frames: int) -> M:
    """A dataclass of arrays by frame, control and torque by step, of the first `frames` frames."""
    arrays = {f.name: getattr(motion, f.name) for f in fields(motion)}  # type: ignore[arg-type]
    cut = {
        name: array[: frames - (name in ("control", "torque"))]
        for name, array in arrays.items()
        if isinstance(array, np.ndarray)
    }
    return replace(motion, **cut)  # type: ignore[type-var]


def simulate(
    stepper: Stepper,
    q: Array,
    v: Array,
    steps: int,
    controller: Controller,
    push: Push | None = None,
    observe: Observer | None = None,
) -> tuple[Rollout, int]:
    """Step from q (57,), v (56,), and how many frames that reached.

    Fewer than steps + 1 where it diverged, or where `observe` ended it.
    """
    model = stepper.model
    frames = steps + 1
    out = Rollout(
        q=np.empty((frames, model.nq)),
        v=np.empty((frames, model.nv)),
        control=np.zeros((steps, model.nu)),
        torque=np.zeros((steps, model.nu)),
        com=np.zeros((frames, 3)),
        com_velocity=np.zeros((frames, 3)),
        diverged=False,
    )
    stepper.start(q, v)
    if push is not None:
        stepper.push(push)
    for t in range(steps):
        out.q[t], out.v[t] = stepper.q, stepper.v
        out.control[t] = controller(t, stepper.q, stepper.v)
        stepper.step(out.control[t])
        if stepper.diverged:
            out.q[t:], out.v[t:] = out.q[t], out.v[t]
            return replace(out, diverged=True), t + 1
        out.com[t], out.com_velocity[t] = stepper.com
        out.torque[t] = stepper.torque
        if observe is not None and not observe(t, stepper):
            return out, t + 1
    out.q[-1], out.v[-1] = stepper.q, stepper.v
    stepper.sense()
    out.com[-1], out.com_velocity[-1] = stepper.com
    return out, frames

"""What the plots show of a performance, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.character.joint_error import joint_errors
from physique.character.model import Character
from physique.runs.run import Run
from physique.simulation.ground_reaction import ground_reaction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """Of T frames; NaN where nothing is known.

    error: (T,) m, mean distance of the joints from the reference's.
    torque: (T, 50) Nm, in the step to the next frame.
    floor: (T, 2, 3) N, world, on the left and the right foot in that step.
    pressure: (T, 2, 2) m, x and y of the centres of pressure; NaN in the air.
    """

    error: Array
    torque: Array
    floor: Array
    pressure: Array


def unknown(frames: int) -> Curves:
    """Curves of a performance that has not begun; they are filled in place."""
    shapes = ((), (50,), (2, 3), (2, 2))
    return Curves(*(np.full((frames, *shape), np.nan) for shape in shapes))


def recorded(run: Run, character: Character, joints: Array, wanted: Array) -> Curves:
    """Curves of the run itself; joints and wanted (T, 22, 3) m, its own and its reference's."""
    trajectory = run.trajectory
    out = unknown(trajectory.frames)
    out.error[:] = joint_errors(joints, wanted).mean(axis=1)
    steps = len(trajectory.control)
    floor = ground_reaction(character, trajectory.q, trajectory.v, trajectory.control)
    out.torque[:steps] = trajectory.torque
    out.floor[:steps], out.pressure[:steps] = floor.feet, floor.pressure
    return out


def difficulty(run: Run) -> Array:
    """(T,) cost E per second of horizon of the window that each frame belongs to."""
    out = np.full(run.trajectory.frames, np.nan)
    for window in run.metrics["windows"]:
        # A frame on the border of two windows belongs to the earlier one.
        inside = (run.trajectory.times > window["start"] + 1e-9) | (window["start"] == 0.0)
        inside &= run.trajectory.times <= window["end"] + 1e-9
        out[inside & np.isnan(out)] = window["difficulty"]
    return out

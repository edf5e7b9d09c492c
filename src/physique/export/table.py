"""A run as a table for biomechanics: angles, torques against their limits, forces of the floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.character.hinges import HINGES
from physique.runs.run import Run
from physique.simulation.ground_reaction import ground_reaction
from physique.store import PathLike, write_atomic

Array = NDArray[np.float64]

_PELVIS_ORDER = "zxy"  # rotation, list, tilt, as gait analysis has them


def write_table(path: PathLike, run: Run, *, source: bool = False) -> Path:
    """Write time, pose, torques and ground reaction as CSV, a row a frame, the unit in each name.

    source: adds the pose of the source motion to each row, in columns that begin with source_, and
    how far it was moved over the floor before errors were measured against it.
    Torques and forces act from a row's time to the next one's; the last row has none. Raises
    InputError where the file cannot be written.
    """
    path = Path(path)
    character, motion = run.character(), run.trajectory
    columns: dict[str, Array] = {"time_s": motion.times, **_pose("", motion.q)}
    if source:
        columns |= _pose("source_", motion.source_q)
        columns |= {f"source_moved_{axis}_m": motion.shift[:, k] for k, axis in enumerate("xy")}
    frames = motion.frames
    for i, hinge in enumerate(HINGES):
        columns[f"{hinge.name}_torque_Nm"] = _padded(motion.torque[:, i])
        columns[f"{hinge.name}_limit_Nm"] = np.full(frames, character.torque_limit[i])
    floor = ground_reaction(character, motion.q, motion.v, motion.control)
    for side, name in enumerate(("left", "right")):
        for k, axis in enumerate("xyz"):
            columns[f"{name}_foot_force_{axis}_N"] = _padded(floor.feet[:, side, k])
        for k, axis in enumerate("xy"):
            columns[f"{name}_foot_pressure_{axis}_m"] = _padded(floor.pressure[:, side, k])
    for k, axis in enumerate("xyz"):
        columns[f"other_force_{axis}_N"] = _padded(floor.other[:, k])
    lines = [",".join(columns)]
    for row in np.stack(list(columns.values()), axis=1) + 0.0:
        lines.append(",".join("" if np.isnan(x) else f"{x:.6g}" for x in row))
    write_atomic(path, ("\n".join(lines) + "\n").encode())
    return path


def _pose(prefix: str, q: Array) -> dict[str, Array]:
    """Columns of the pelvis and all joint angles of q (T, 57)."""
    columns = {f"{prefix}pelvis_{axis}_m": q[:, k] for k, axis in enumerate("xyz")}
    turns = np.unwrap(rotations.to_euler(_PELVIS_ORDER, rotations.normalize(q[:, 3:7])), axis=0)
    for k, name in enumerate(("rotation", "list", "tilt")):
        columns[f"{prefix}pelvis_{name}_deg"] = np.degrees(turns[:, k])
    for i, hinge in enumerate(HINGES):
        columns[f"{prefix}{hinge.name}_deg"] = np.degrees(q[:, 7 + i])
    return columns


def _padded(values: Array) -> Array:
    """Values of N steps as N + 1 rows."""
    return np.append(values, np.nan)

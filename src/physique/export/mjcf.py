"""The character as a MuJoCo model that holds its motion, as keyframes."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from physique.character.state import finite_velocity
from physique.render.sampling import RATE, frames_at
from physique.runs.run import Run
from physique.store import PathLike, write_atomic


def write_mjcf(path: PathLike, run: Run, *, source: bool = False, rate: float | None = None) -> Path:
    """Write the simulated motion, or with `source` the source motion, as an MJCF model.

    A keyframe has time, qpos and qvel; one of the simulation its ctrl too, the targets that lead
    on from there. rate: keyframes a second, at most those of the run; the nearest frames are
    taken. Raises InputError for a rate that is not positive, or where the file cannot be written.
    """
    path = Path(path)
    motion = run.trajectory
    frames = frames_at(len(motion.q), 1.0 / run.timestep, RATE if rate is None else rate)
    q, v, control = motion.q, motion.v, motion.control
    if source:
        q, v = motion.source_q, finite_velocity(motion.source_q, run.timestep)
    root = ElementTree.fromstring(run.character_xml)
    keyframe = ElementTree.SubElement(root, "keyframe")
    for t in frames:
        key = {"name": f"frame_{t}", "time": f"{motion.times[t]:.6g}"}
        key |= {"qpos": _row(q[t]), "qvel": _row(v[t])}
        if len(control) and not source:
            # The last frame leads nowhere: it keeps the targets before it.
            key["ctrl"] = _row(control[min(t, len(control) - 1)])
        ElementTree.SubElement(keyframe, "key", key)
    ElementTree.indent(root)
    write_atomic(path, ElementTree.tostring(root, encoding="unicode").encode() + b"\n")
    return path


def _row(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.12g}" for value in values)

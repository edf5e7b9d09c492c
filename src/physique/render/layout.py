"""Runs in one picture: where each of them stands, and what tells it from the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from physique.render.skin import joint_transforms
from physique.runs.run import Run

Array = NDArray[np.float64]

_FLESH = 0.15  # m, from the outermost joints to the outermost skin
_GAP = 0.25  # m, of free floor between two runs


def side_by_side(runs: Sequence[Run]) -> Array:
    """Shifts (N, 3), m, world, after which no two runs, or their sources, ever meet.

    Seen by someone whom they face, the first stands on the left; their middle is at y = 0.
    """
    spans = [_span(run) for run in runs]
    shifts = np.zeros((len(runs), 3))
    edge = 0.0
    for shift, (low, high) in zip(shifts, spans):
        shift[1] = edge - low
        edge += high - low + _GAP
    shifts[:, 1] -= (edge - _GAP) / 2 if len(runs) > 1 else shifts[0, 1]
    return shifts


def _span(run: Run) -> tuple[float, float]:
    """The least and the largest y, m, that the body or its source ever takes."""
    motions = (run.trajectory.q, run.trajectory.source_q)
    y = np.concatenate([joint_transforms(run.body, q)[:, :, 1, 3] for q in motions])
    return float(y.min()) - _FLESH, float(y.max()) + _FLESH


def labels(runs: Sequence[Run]) -> list[str]:
    """What tells runs apart, as short as it can be: the body, with its strength, with what it
    holds, with the clip, or the folder; numbered where nothing does."""
    names = [run.name for run in runs]
    for found in (
        [run.body.name for run in runs],
        [f"{run.body.name}, {strength(run)}" for run in runs],
        [f"{run.body.name}, {run.holding or 'empty hands'}" for run in runs],
        names,
        [run.name if run.folder is None else run.folder.name for run in runs],
    ):
        if len(set(found)) == len(found):
            return found
    return [f"{name} ({index})" for index, name in enumerate(names, start=1)]


def strength(run: Run) -> str:
    """How strong the joints of a run are."""
    value = run.record["identity"].get("torque_limit", "body")
    return "own strength" if value == "body" else f"{value:g} Nm at every joint"

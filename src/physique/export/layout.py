"""Runs in one picture: where each of them stands and which colour it has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from physique.run import Run
from physique.simulation import reduced

Array = NDArray[np.float64]

#: Colours of the runs, sRGB; told apart by people with any colour vision (Okabe and Ito, 2008).
COLOURS = ("#e69f00", "#56b4e9", "#009e73", "#cc79a7", "#d55e00", "#0072b2", "#f0e442")
#: Of the reference motion.
SOURCE_COLOUR = "#b9c0c8"

_FLESH = 0.15  # m, from the outermost joints to the outermost skin
_GAP = 0.25  # m, of free floor between two runs


def colour(index: int) -> str:
    """The sRGB colour, "#rrggbb", of run number `index`."""
    return COLOURS[index % len(COLOURS)]


def linear_rgb(srgb: str) -> list[float]:
    """Linear red, green, blue in 0 to 1 of an sRGB colour "#rrggbb" (IEC 61966-2-1)."""
    values = [int(srgb[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values]


def side_by_side(runs: Sequence[Run]) -> Array:
    """Shifts (N, 3), m, world, after which no two runs, or their references, ever meet.

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
    """The least and the largest y, m, that the body or its reference ever takes."""
    ends = []
    for q in (run.trajectory.q, run.trajectory.reference_q):
        local = reduced.to_rotations(q[:, 3:7], q[:, 7:])
        joints = reduced.part_transforms(local, run.body.joints)[..., 3] + q[:, None, :3]
        ends += [joints[..., 1].min(), joints[..., 1].max()]
    return float(min(ends)) - _FLESH, float(max(ends)) + _FLESH

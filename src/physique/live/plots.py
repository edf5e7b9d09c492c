"""Curves beside the scene, with a line at the current time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HEIGHT = 150  # pixels
MOST_POINTS = 400
NOW = "#444444"
#: The plot goes this part beyond the highest value.
ROOM = 1.08


class Plot:
    """A plot over the time of the clip.

    names, colours: of the curves. top: the least that the vertical axis reaches; it grows with the
    data, so that the line of the current time always spans it.
    """

    def __init__(
        self,
        gui: Any,
        title: str,
        times: Array,
        names: Sequence[str],
        colours: Sequence[str],
        top: float,
        bottom: float = 0.0,
    ) -> None:
        stride = max(1, -(-len(times) // MOST_POINTS))
        self._rows = slice(None, None, stride)
        self._times = times[self._rows]
        self._now = 0
        self._floor, self._least_top, self._top = bottom, top, top
        self._curves = [np.full(len(self._times), np.nan) for _ in names]
        curves = [
            {"label": name, "stroke": colour, "width": 1.5, "points": {"show": False}}
            for name, colour in zip(names, colours)
        ]
        line = {"label": "now", "stroke": NOW, "width": 1, "points": {"show": False}}
        self._handle = gui.add_uplot(
            self._data(),
            series=({"label": "s"}, *curves, line),
            title=title,
            scales={"x": {"time": False}, "y": {"range": [bottom, top]}},
            legend={"show": False},
            height=HEIGHT,
        )

    def show(self, curves: Sequence[Array], frame: int) -> None:
        """Show curves (T,) and the line at a frame."""
        self._curves = [np.asarray(curve, dtype=float)[self._rows] for curve in curves]
        self._now = min(frame // (self._rows.step or 1), len(self._times) - 1)
        highest = max((float(np.nanmax(c)) for c in self._curves if np.isfinite(c).any()), default=0.0)
        too_low = self._top > self._least_top and highest < 0.3 * self._top
        if ROOM * highest > self._top or too_low:
            self._top = max(self._least_top, 1.3 * highest)
            self._handle.scales = {"x": {"time": False}, "y": {"range": [self._floor, self._top]}}
        self._handle.data = self._data()

    def _data(self) -> tuple[Array, ...]:
        """The times, the curves, and the line: two points, one sample apart."""
        line = np.full(len(self._times), np.nan)
        last = len(line) - 1
        at = min(self._now, max(last - 1, 0))
        line[at], line[min(at + 1, last)] = self._floor, self._top
        return (self._times, *self._curves, line)

"""Which parts of a clip are hard for a body, and why: the windows of a run, read for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.character.hinges import HINGES
from physique.report.words import hinge_words, joint_words, length
from physique.runs.metrics import SATURATED
from physique.runs.run import Run

Array = NDArray[np.float64]

#: Levels by `difficulty`, E a second, up to which they reach. At 25 (E of 20 in a window of 0.8 s)
#: the optimiser itself takes a window for hard and keeps less of it.
LEVELS = (("easy", 3.0), ("fair", 10.0), ("hard", 25.0), ("very hard", np.inf))

#: What groups of terms of Eq. 2 mean to someone who looks at the motion.
CAUSES: dict[str, tuple[tuple[str, ...], str]] = {
    "balance": (("com", "com_velocity"), "the body's weight is not where the recording carries it"),
    "pose": (("pose",), "joints do not reach the recorded angles"),
    "trunk": (("root",), "the hips are turned away from the recording"),
    "speed": (("velocity", "acceleration"), "joints are not as fast as recorded"),
}
_LEADING = 0.3  # share of E from which a cause is named
_OFTEN = 0.15  # share of a window's steps from which strength and contact are causes


@dataclass(frozen=True)
class Passage:
    """One window: start, end, s; difficulty, E a second, and its level; causes, the heaviest first.

    Each cause is a word and a sentence. shares: of E, by the words of `CAUSES`.
    """

    start: float
    end: float
    difficulty: float
    level: str
    causes: tuple[tuple[str, str], ...]
    shares: dict[str, float]


def parts(run: Run, use: Array, error: Array, on_floor: NDArray[np.bool_]) -> list[Passage]:
    """The windows of a run.

    use: (T - 1, 50), torques as parts of their limits. error: (T, 22) mm, of the joints.
    on_floor: (2, T, 2), whether the left and the right foot are on the floor, in the simulation and
    in the reference.
    """
    step = float(run.trajectory.times[1]) if run.trajectory.frames > 1 else 0.01
    found = []
    for window in run.metrics["windows"]:
        span = slice(round(window["start"] / step), round(window["end"] / step))
        shares = _shares(window["cost_terms"])
        level = "lost" if not window["success"] else _level(window["difficulty"])
        leading = [w for w in sorted(shares, key=lambda w: -shares[w]) if shares[w] >= _LEADING]
        far = _furthest(error[span.start + 1 : span.stop + 1])
        causes = [
            *_strength(use[span]),
            *((w, CAUSES[w][1] + (f"; furthest off: {far}" if w == "pose" else "")) for w in leading),
            *_contact(on_floor[:, span]),
        ]
        found.append(
            Passage(
                start=window["start"],
                end=window["end"],
                difficulty=window["difficulty"],
                level=level,
                causes=tuple(causes) if level != "easy" else (),
                shares=shares,
            )
        )
    return found


def _level(difficulty: float) -> str:
    return next(name for name, reach in LEVELS if difficulty < reach)


def _shares(terms: Mapping[str, Any]) -> dict[str, float]:
    sums = {word: sum(terms.get(t, 0.0) for t in names) for word, (names, _) in CAUSES.items()}
    total = sum(sums.values())
    return {word: value / total if total > 0 else 0.0 for word, value in sums.items()}


def _furthest(error: Array) -> str:
    """The two joints that are furthest off, on average over the frames of error (N, 22), mm."""
    mean = error.mean(axis=0)
    two = np.argsort(-mean, kind="stable")[:2]
    return ", ".join(f"{joint_words(skeleton.JOINTS[i])} {length(mean[i])}" for i in two)


def _strength(use: Array) -> list[tuple[str, str]]:
    """Joints that are at their limit often in these steps."""
    if len(use) == 0:
        return []
    full = (use >= SATURATED).mean(axis=0)
    often = [i for i in np.argsort(-full, kind="stable")[:3] if full[i] >= _OFTEN]
    if not often:
        return []
    named = [f"{hinge_words(HINGES[i].name)} {100 * full[i]:.0f} %" for i in often]
    named[0] += " of the time"
    return [("strength", f"at the limit: {', '.join(named)}")]


def _contact(on_floor: NDArray[np.bool_]) -> list[tuple[str, str]]:
    """Feet that are down where they should be up, or up where they should be down."""
    simulated, recorded = on_floor
    if len(simulated) == 0:
        return []
    causes = []
    for name, wrong in (
        ("on the floor where the recording has it in the air", simulated & ~recorded),
        ("in the air where the recording has it on the floor", ~simulated & recorded),
    ):
        for side, share in zip(("left", "right"), wrong.mean(axis=0)):
            if share >= _OFTEN:
                causes.append(f"{side} foot {name}, {100 * share:.0f} % of the time")
    return [("contact", "; ".join(causes))] if causes else []

"""Section 5, time horizon: two kicks of a heavy man, with limits that fit him and with 100 Nm.

    python -m physique.experiments.horizon --write docs/section5.md

The clip is CMU 135_04 of ../shared/mocap; where it is not at hand, the embedded kick. Takes some
minutes; what is finished is kept in out/section5.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from physique.experiments.section5 import (
    Array,
    Picture,
    Section5,
    ankles,
    limits_in_words,
    markdown,
    present,
    sheet,
    yes,
)
from physique.runs.run import Run

log = logging.getLogger(__name__)

KICKS = Path(__file__).resolve().parents[4] / "shared" / "mocap" / "cmu" / "bvh" / "135_04.bvh"
PART = 2.0, 6.0  # s
HORIZONS = (0.8, 0.9, 1.0)  # s
LIMITS: tuple[Any, ...] = ("body", 100.0)
FALLEN = 0.5  # of the standing height of the pelvis
TEXT = """## Time horizon

{clip} on the heavy man (155 kg). Of each kick: the height of the ankle at its top. Down: when the
pelvis first came below half its standing height. The paper's character fell with 0.8 and 0.9 s and
stood with 1.0 s, with limits of 100 Nm and its sampling optimiser, which keeps 0.4 s of each
window; this optimiser keeps 0.3 s, or 0.15 s where the body cannot follow.

"""
#: Of the clip that the paper's figure resembles.
FOUND = """With the limits of his own strength he stands with each of the three, so there is nothing for a
longer horizon to repair. 100 Nm are too weak for 155 kg: with 0.8 s he goes down on a knee after
the first kick, gets up and kicks again; with 0.9 and 1.0 s he goes down before it and is lost.
There the horizon changes what he does, but not in the paper's order: who looks further ahead gives
in sooner.

"""
HEAD = "limits | horizon | followed | error, mean mm | worst frame | kicks mm | down | thousand steps/s"


def measure(options: Section5) -> tuple[str, Picture]:
    """Text and picture."""
    clip: str | Path = KICKS
    start, end = PART
    if not KICKS.is_file():
        log.warning("no %s in ../shared/mocap: the embedded kick instead", KICKS.name)
        clip, start, end = "kick", 0.0, np.inf
    last = end if options.end is None else min(end, start + options.end)
    reading = {"start": start, "end": last} if np.isfinite(last) else {}
    table, rows = [HEAD.split(" | ")], []
    for limit in LIMITS:
        for seconds in HORIZONS:
            name = f"kicks_{limit}_{seconds:g}"
            run = options.run(clip, "heavy", name, torque_limit=limit, horizon=seconds, **reading)
            m, q = run.metrics, run.trajectory.q
            label = limits_in_words(limit)
            table.append(
                [
                    label,
                    f"{seconds:g} s",
                    yes(m["success"]),
                    f"{m['mpjpe_mm']:.0f}",
                    f"{m['mpjpe_max_mm']:.0f}",
                    _kicks(run, q),
                    _down(run),
                    f"{m['sim_steps_per_motion_s'] / 1e3:.0f}",
                ]
            )
            rows.append((f"{label}, {seconds:g} s", run, q))
    table.append(["", "reference", "", "", "", _kicks(run, run.trajectory.reference_q), "", ""])
    real = clip == KICKS
    text = TEXT.format(clip="Two front kicks (CMU 135_04, 2 to 6 s)" if real else "The embedded `kick`")
    return text + (FOUND if real else "") + markdown(table), sheet(rows)


def _kicks(run: Run, q: Array) -> str:
    """Greatest height, mm, of an ankle in each half of the motion."""
    heights = 1e3 * ankles(run, q).max(axis=1)
    return ", ".join(f"{half.max():.0f}" for half in np.array_split(heights, 2))


def _down(run: Run) -> str:
    """When the pelvis came down to half its height."""
    low = run.trajectory.q[:, 2] < FALLEN * run.body.joints[0, 2]
    return f"at {run.trajectory.times[np.argmax(low)]:.2f} s" if low.any() else "no"


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and store."""
    present("horizon", measure, arguments)


if __name__ == "__main__":
    main()

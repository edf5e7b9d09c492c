"""Whole clips on several bodies: error, success and price, as the table of docs/results.md.

    make bench            every row, about half an hour on two cores
    benchmarks/run.py --only walk --body average

Each row is stored in FOLDER/results.json as it ends (`--out FOLDER`): stopped, it goes on where it
was, and rows that the present code made are not made again. Rows of which the motion file is not at
hand (../shared/mocap) are left out and named.
"""

from __future__ import annotations

import argparse
import resource
import sys
from functools import partial
from pathlib import Path
from typing import Any

import physique
from physique.experiments.cells import Cells

ROOT = Path(__file__).resolve().parent.parent
CMU = ROOT.parent / "shared" / "mocap" / "cmu"
LIBRARY = (
    "run",
    "jump",
    "dance_a",
    "spin",
    "kick",
    "spinkick",
    "crawl",
    "roll",
    "getup_faceup",
    "getup_facedown",
    "cartwheel",
    "backflip",
)
#: Name -> clip, options of the reading, bodies, torque limits.
ROWS: dict[str, tuple[str | Path, dict[str, Any], tuple[str, ...], tuple[Any, ...]]] = {
    "walk": ("walk", {}, ("average", "thin", "heavy"), ("body",)),
    "punch": ("punch", {}, ("average",), ("body",)),
    "salsa 60_01, 2 to 6 s": (
        CMU / "bvh/60_01.bvh",
        {"fps": 60, "start": 2, "end": 6},
        ("average", "thin", "heavy"),
        ("body",),
    ),
    "salsa 60_01, whole": (CMU / "bvh/60_01.bvh", {"fps": 60}, ("average",), ("body",)),
    "walk 02_01": (CMU / "asfamc/02/02_01.amc", {}, ("average",), ("body",)),
    "slow walk 07_04": (CMU / "asfamc/07/07_04.amc", {}, ("average",), ("body",)),
    "front kick 135_04, 2 to 6 s": (
        CMU / "bvh/135_04.bvh",
        {"start": 2, "end": 6},
        ("average",),
        ("body", 100.0),
    ),
    "front kick 135_04, whole": (CMU / "bvh/135_04.bvh", {}, ("average",), ("body", 100.0)),
    **{name: (name, {}, ("average",), ("body",)) for name in LIBRARY},
}
#: Of each run's metrics.
KEPT = (
    "success",
    "mpjpe_mm",
    "mpjpe_max_mm",
    "foot_skate_planted_mm_per_s",
    "foot_skate_source_mm_per_s",
    "penetration_mm",
    "sim_steps_per_motion_s",
    "wall_s_per_motion_s",
)
HEAD = (
    "| clip | body | limits | followed | error, mean mm | worst frame "
    "| standing feet skate mm/s (recording) | penetration mm | thousand steps/s | compute s/s |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
)


def main() -> None:
    """Run the rows that were asked for and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", help="rows whose name contains this")
    parser.add_argument("--body", help="just this body")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "bench")
    parser.add_argument("--write", type=Path, help="write the table to this file too")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cells = Cells(options.out / "results.json")
    rows: list[dict[str, Any]] = []
    lines = []
    for name, (clip, reading, bodies, limits) in ROWS.items():
        if options.only and options.only not in name:
            continue
        if isinstance(clip, Path) and not clip.is_file():
            print(f"left out, no {clip.name} here: {name}", file=sys.stderr)
            continue
        for body in bodies:
            if options.body not in (None, body):
                continue
            for limit in limits:
                label = f"{name} | {body} | {'body' if limit == 'body' else f'{limit:g} Nm'}"
                work = partial(measure, clip, body, limit, reading)
                rows.append(cells.make(label, work, **reading))
                lines.append(f"| {label} | {entries(rows[-1])} |\n")
                print(lines[-1], end="", flush=True)
    memory = max((row["peak_memory_mb"] for row in rows), default=0.0)
    text = HEAD + "".join(lines) + f"\nPeak memory of the whole table: {memory:.0f} MB.\n"
    (options.out / "results.md").write_text(text)
    if options.write:
        options.write.write_text(
            "# Results\n\nMade by `make bench` on two cores (`benchmarks/run.py`); errors are "
            "against the reference as moved for each window ([metrics](metrics.md)). Seconds are "
            "of a shared machine: compare them within the table only.\n\n" + text
        )


def measure(clip: str | Path, body: str, limit: Any, reading: dict[str, Any]) -> dict[str, Any]:
    """What the table needs of one run."""
    m = physique.retarget(clip, body, torque_limit=limit, **reading).metrics
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {**{key: m[key] for key in KEPT}, "peak_memory_mb": memory}


def entries(m: dict[str, Any]) -> str:
    """A row of the table from "followed" on."""
    return (
        f"{'yes' if m['success'] else 'no'} | {m['mpjpe_mm']:.1f} "
        f"| {m['mpjpe_max_mm']:.0f} | {m['foot_skate_planted_mm_per_s']:.0f} "
        f"({m['foot_skate_source_mm_per_s']:.0f}) | {m['penetration_mm']:.1f} "
        f"| {m['sim_steps_per_motion_s'] / 1e3:.0f} | {m['wall_s_per_motion_s']:.1f}"
    )


if __name__ == "__main__":
    main()

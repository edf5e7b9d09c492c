"""Every clip on every ready body: who can follow what, and where it fails.

    python benchmarks/matrix.py                      # the average body: a quarter of an hour on two cores
    python benchmarks/matrix.py --bodies heavy,thin  # other columns
    python benchmarks/matrix.py --bodies all         # hours
    python benchmarks/matrix.py --clips walk,punch   # some rows
    python benchmarks/matrix.py --report             # the page from what is stored

Clips are the embedded ones and the flat-ground ones of ../shared/mocap, where it is at hand. Cells
run side by side, each on one thread, and each is stored as it ends: stopped, it goes on where it
was, and cells that the present code made are not made again. Writes benchmarks/results/matrix.json,
docs/matrix.md and docs/images/matrix.png, under another folder with `--out FOLDER`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import physique
from physique.body.named import PEOPLE
from physique.experiments.cells import Cells
from physique.motion.library import list_clips
from physique.render.picture import strip
from physique.render.scene import stage_runs

ROOT = Path(__file__).resolve().parents[1]
MOCAP = ROOT.parent / "shared" / "mocap"
RESULTS = Path("benchmarks") / "results" / "matrix.json"
#: Hands on the floor, flips and floor work; all else is everyday.
ACROBATIC = {"backflip", "cartwheel", "roll", "spinkick", "crawl", "getup_facedown", "getup_faceup"}
#: Files whose header has the wrong frame rate.
TRUE_FPS = {"60_01": 60.0, "60_06": 60.0}
#: Whose pictures the page shows: a clip, a body.
PICTURES = (("walk", "heavy"), ("kick", "average"), ("cartwheel", "average"), ("backflip", "thin"))


#: Of each run's metrics.
KEPT = (
    "success",
    "mpjpe_mm",
    "mpjpe_max_mm",
    "penetration_mm",
    "foot_skate_planted_mm_per_s",
    "foot_skate_source_mm_per_s",
    "sim_steps_per_motion_s",
)


@dataclass(frozen=True)
class Clip:
    """name: in the table; path: as `retarget` takes it."""

    name: str
    path: str
    fps: float | None = None


def clips() -> list[Clip]:
    """All rows."""
    found = [Clip(c.name, c.name) for c in list_clips()]
    files = [*MOCAP.glob("cmu/asfamc/**/*.amc"), *MOCAP.glob("cmu/bvh/*.bvh")]
    for path in [*sorted(files), *sorted(MOCAP.glob("other/*.bvh"))]:
        found.append(Clip(path.name, str(path), TRUE_FPS.get(path.stem)))
    return found


def run_cell(clip: Clip, body: str) -> dict[str, Any]:
    """What the table needs of one run."""
    before = time.process_time()
    try:
        run = physique.retarget(clip.path, body, fps=clip.fps, threads=1)
    except physique.InputError as error:
        return {"refused": str(error)}
    m = run.metrics
    out: dict[str, Any] = {key: m[key] for key in KEPT}
    out["seconds"] = float(run.trajectory.times[-1])
    # Of the processor, not of the clock: other work on the machine does not count.
    out["cpu_s_per_motion_s"] = (time.process_time() - before) / out["seconds"]
    lost = next((w for w in m["windows"] if not w["success"]), None)
    if lost is not None:
        out["lost_s"] = lost["start"]
        out["hardest"] = max(lost["cost_terms"], key=lost["cost_terms"].get)
    return out


def main() -> None:
    """Run the cells that are asked for and not stored, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clips", help="only these, by commas")
    parser.add_argument("--bodies", default="average", help="these, by commas, or all")
    parser.add_argument("--workers", type=int, default=2, help="cells side by side")
    parser.add_argument("--report", action="store_true", help="only the page")
    parser.add_argument("--out", type=Path, default=ROOT, help="write under this folder")
    options = parser.parse_args()
    cells = Cells(options.out / RESULTS)
    if not options.report:
        rows = [c for c in clips() if not options.clips or c.name in options.clips.split(",")]
        bodies = list(PEOPLE) if options.bodies == "all" else options.bodies.split(",")
        asked = [(clip, body) for body in bodies for clip in rows]
        wanted = [(clip, body) for clip, body in asked if not cells.has(cell_name(clip, body), fps=clip.fps)]
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(options.workers, mp_context=spawn) as pool:
            running = {pool.submit(run_cell, *cell): cell for cell in wanted}
            for count, done in enumerate(as_completed(running), 1):
                clip, body = running[done]
                cell = cells.put(cell_name(clip, body), done.result(), fps=clip.fps)
                print(f"{count}/{len(wanted)} {clip.name}, {body}: {entry(cell)}", flush=True)
    if not cells.values:
        raise SystemExit("nothing is stored yet: run some cells first")
    write_page(cells, options.out / "docs")


def cell_name(clip: Clip, body: str) -> str:
    """Under which a cell is stored."""
    return f"{clip.name}, {body}"


def entry(cell: dict[str, Any] | None) -> str:
    """A cell of the table."""
    if cell is None:
        return ""
    if "refused" in cell:
        return "refused"
    if cell["success"]:
        return f"{cell['mpjpe_mm']:.0f}"
    return f"lost at {cell['lost_s']:.1f} s"


def write_page(stored: Cells, docs: Path) -> None:
    """docs/matrix.md and its picture."""
    cells: dict[str, dict[str, Any]] = {}  # clip -> body -> cell
    for name, cell in stored.values.items():
        clip, body = name.rsplit(", ", 1)
        cells.setdefault(clip, {})[body] = cell
    bodies = [b for b in PEOPLE if any(b in row for row in cells.values())]
    order = sorted(cells, key=lambda name: (name in ACROBATIC, name))
    lines = [
        "# Who can follow what",
        "",
        "Mean error in mm (world, against the reference as moved for each window) of every clip on",
        "every body, with torque limits that fit the body; *lost* where the mean error of a frame",
        "passed 0.5 m, and when. Made by `python benchmarks/matrix.py --bodies all`.",
        "",
        "| clip | s | " + " | ".join(bodies) + " |",
        "| --- " * (len(bodies) + 2) + "|",
    ]
    for name in order:
        row = cells[name]
        seconds = next((c["seconds"] for c in row.values() if "seconds" in c), 0.0)
        mark = " *" if name in ACROBATIC else ""
        entries = " | ".join(entry(row.get(body)) for body in bodies)
        lines.append(f"| {name}{mark} | {seconds:.1f} | {entries} |")
    lines += ["", "\\* acrobatic: hands on the floor, flips, floor work.", ""]
    if stored.codes > 1:
        lines += [f"Cells of {stored.codes} versions of the code are mixed here.", ""]
    lines += summary(cells, bodies)
    lines += ["", "![Four of them](images/matrix.png)", ""]
    docs.mkdir(parents=True, exist_ok=True)
    (docs / "matrix.md").write_text("\n".join(lines), encoding="utf-8")
    (docs / "images").mkdir(exist_ok=True)
    Image.fromarray(pictures()).save(docs / "images" / "matrix.png", optimize=True)


def summary(cells: dict[str, dict[str, Any]], bodies: list[str]) -> list[str]:
    """Success by kind, medians on each body, and why bodies were lost."""
    lines = [
        "| | cells | followed | median error mm | median processor s/s | median penetration mm "
        "| standing feet slide less than the recording's |",
        "| --- " * 7 + "|",
    ]
    for label, chosen in (
        ("everyday", [n for n in cells if n not in ACROBATIC]),
        ("acrobatic", [n for n in cells if n in ACROBATIC]),
        ("all", list(cells)),
    ):
        for columns, kind in ((["average"], "the average body"), (bodies, "all bodies")):
            found = [cells[n][b] for n in chosen for b in columns if "success" in cells[n].get(b, {})]
            if not found:
                continue
            lines.append(
                f"| {label}, {kind} | {len(found)} "
                f"| {100 * np.mean([c['success'] for c in found]):.0f} % "
                f"| {np.median([c['mpjpe_mm'] for c in found]):.1f} "
                f"| {np.median([c['cpu_s_per_motion_s'] for c in found]):.1f} "
                f"| {np.median([c['penetration_mm'] for c in found]):.1f} "
                f"| {100 * np.mean([slides_less(c) for c in found]):.0f} % |"
            )
    lost = [
        f"- {name}, {body}: at {cell['lost_s']:.1f} s; most of E there is `{cell['hardest']}`"
        for name in cells
        for body, cell in cells[name].items()
        if "lost_s" in cell
    ]
    refused = [
        f"- {name}, {body}: {cell['refused']}"
        for name, row in cells.items()
        for body, cell in row.items()
        if "refused" in cell
    ]
    if lost:
        lines += ["", "Lost:", "", *lost]
    if refused:
        lines += ["", "Refused:", "", *refused]
    return lines


def slides_less(cell: dict[str, Any]) -> bool:
    """Whether standing feet skate at most as much as in the recording, both to the mm/s."""
    return round(cell["foot_skate_planted_mm_per_s"]) <= round(cell["foot_skate_source_mm_per_s"])


def pictures() -> np.ndarray:
    """Strips of `PICTURES`, one below the other: the source as a ghost, the body beside it."""
    runs = [physique.retarget(clip, body) for clip, body in PICTURES]
    return strip([stage_runs([run], (180, 180), source=True) for run in runs], 6)


if __name__ == "__main__":
    main()

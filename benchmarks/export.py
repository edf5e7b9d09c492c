"""What each export format takes, in seconds and bytes, for a run.

    python benchmarks/export.py RUN [--seconds 10]

RUN is the folder of a run; it is repeated until it is `--seconds` long. Compiled loops are warm and
imports are done. Wall time is of this process as the machine let it; CPU time is its own.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from physique.commands.export import export_run
from physique.export.formats import FORMATS
from physique.runs.run import Run, load_run
from physique.tracking.trajectory import Trajectory


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args()
    run = repeated(load_run(arguments.run), arguments.seconds)
    print("| format | wall s | CPU s | kB | CPU s a picture |\n| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for kind in FORMATS:
            out = Path(folder) / f"run{kind.suffixes[0]}"
            short = repeated(run, 0.1)
            export_run(short, kind.name, out, source=kind.together)
            wall, cpu = time.perf_counter(), time.process_time()
            export_run(run, kind.name, out)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            pictures = 25 * arguments.seconds + 1
            each = f"{cpu / pictures:.3f}" if kind.name == "mp4" else ""
            size = out.stat().st_size / 1000
            print(f"| {kind.name} | {wall:.2f} | {cpu:.2f} | {size:.0f} | {each} |", flush=True)


def repeated(run: Run, seconds: float) -> Run:
    """The run as often as it takes to make this many seconds of it."""
    motion = run.trajectory
    frames = round(seconds / run.timestep) + 1
    index = np.arange(frames) % motion.frames
    steps = np.arange(frames - 1) % len(motion.control)
    return replace(
        run,
        trajectory=Trajectory(
            np.arange(frames) * run.timestep,
            motion.q[index],
            motion.v[index],
            motion.control[steps],
            motion.torque[steps],
            motion.reference_q[index],
            motion.shift[index],
        ),
    )


if __name__ == "__main__":
    main()

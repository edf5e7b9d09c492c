"""The main job on what ships with the package: one clip, two bodies, pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physique.character.model import Character
from physique.commands.bodies import write_png
from physique.commands.retarget import Progress, retarget
from physique.render.picture import animation, strip
from physique.runs.run import Run
from physique.store import PathLike, prepare_folder

CLIP, START, END = "walk", 0.0, 1.6  # s
BODIES = ("average", "heavy")


@dataclass(frozen=True)
class DemoResult:
    """The demo's runs, one a body, and the pictures of them."""

    runs: tuple[Run, ...]
    pictures: tuple[Path, ...]


def run_demo(
    out: PathLike, *, threads: int | None = None, progress: Callable[[Progress], None] | None = None
) -> DemoResult:
    """Retarget the demo clip onto the demo bodies; runs and pictures go to the folder `out`.

    Raises InputError where the folder cannot be written.
    """
    folder = prepare_folder(out)
    runs: list[Run] = []
    pictures: list[Path] = []
    strips = []
    for name in BODIES:
        run = retarget(
            CLIP,
            name,
            start=START,
            end=END,
            threads=threads,
            out=folder / name,
            overwrite=True,
            progress=progress,
        )
        character = run.character()
        strips.append(_strip(character, run))
        pictures.append(
            animation(
                character.model,
                run.trajectory.q,
                1.0 / float(character.model.opt.timestep),
                folder / f"{name}.webp",
                run.trajectory.reference_q,
                size=(320, 240),
                rate=12.5,
                threads=threads,
            )
        )
        runs.append(run)
    sheet = folder / "demo.png"
    gap = np.full((6, strips[0].shape[1], 3), 255, dtype=np.uint8)
    rows = [part for picture in strips for part in (gap, picture)][1:]
    write_png(sheet, np.concatenate(rows))
    return DemoResult(tuple(runs), (sheet, *pictures))


def _strip(character: Character, run: Run) -> np.ndarray:
    return strip(
        character.model,
        run.trajectory.q,
        7,
        fps=1.0 / float(character.model.opt.timestep),
        reference_q=run.trajectory.reference_q,
        panel=(150, 210),
        labels=("reference", run.record["identity"]["body"]),
    )

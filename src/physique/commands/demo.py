"""The main job on what ships with the package: one clip, two bodies, pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from physique.commands.bodies import write_png
from physique.commands.retarget import Progress, retarget
from physique.render.picture import animation, strip
from physique.render.scene import stage_runs
from physique.runs.run import Run
from physique.store import PathLike, prepare_folder

CLIP, END = "walk", 1.6  # s
BODIES = ("average", "heavy")
PANEL, FILM = (200, 200), (640, 320)  # pixels
FRAMES, RATE = 5, 12.5  # of the sheet; of the film, a second


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
    runs = tuple(
        retarget(CLIP, name, end=END, threads=threads, out=folder / name, overwrite=True, progress=progress)
        for name in BODIES
    )
    sheet = folder / "demo.png"
    write_png(sheet, strip([stage_runs([run], PANEL, source=True) for run in runs], FRAMES))
    film = animation(folder / "demo.webp", stage_runs(runs, FILM, source=True), RATE, threads=threads)
    return DemoResult(runs, (sheet, film))

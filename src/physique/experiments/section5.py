"""What the experiments of docs/section5.md share: options, runs, tables, pictures and the page."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

from physique import skeleton
from physique.character import kinematics
from physique.commands.bodies import write_png
from physique.experiments.cells import kept_run
from physique.motion.clip import Motion
from physique.render.picture import strip
from physique.render.scene import AZIMUTH, Scene, make_actor, stage
from physique.render.surface import surface
from physique.runs.run import Run
from physique.store import prepare_folder, write_atomic

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
#: A run under its name, and the motion (T, 57) of it that is shown.
Row = tuple[str, Run, Array]

#: Heads of the page's parts, in their order.
HEADS = ("Torque limits", "Time horizon", "Held objects")
PAGE = """# The experiments of the paper's section 5

Made by `python -m physique.experiments.NAME --write docs/section5.md`, NAME being torque, horizon or
objects.
"""
PANEL = (150, 190)  # pixels


@dataclass(frozen=True)
class Section5:
    """An experiment of the paper's section 5, as a table in Markdown.

    Args:
        out: the folder for the runs; those that are there are kept, one that was stopped goes on
        write: a page (.md) to put table and picture into; the picture goes to images/ beside it
        end: s, of each motion; less than all of it for a look
    """

    out: Path = Path("out/section5")
    write: Path | None = None
    end: float | None = None

    def run(self, clip: str | Path | Motion, body: str, name: str, **options: Any) -> Run:
        """The run of this name."""
        return kept_run(
            self.out / f"{name}{'' if self.end is None else f'-{self.end:g}s'}", clip, body, **options
        )


def present(
    name: str, make: Callable[[Section5], tuple[str, Picture]], arguments: list[str] | None = None
) -> None:
    """Make text and picture of an experiment, print the text, and put both into the page."""
    options = tyro.cli(Section5, args=arguments)
    text, picture = make(options)
    sys.stdout.write(text)
    if options.write is None:
        return
    page = options.write
    write_png(prepare_folder(page.parent / "images") / f"section5_{name}.png", picture)
    old = page.read_text(encoding="utf-8") if page.is_file() else ""
    parts = {part.splitlines()[0]: part.rstrip() + "\n" for part in old.split("\n## ")[1:]}
    part = f"{text.removeprefix('## ')}\n![{name}](images/section5_{name}.png)\n"
    parts[part.splitlines()[0]] = part
    body = "".join(f"\n## {parts[head]}" for head in HEADS if head in parts)
    write_atomic(page, (PAGE + body).encode())


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """A table; its first row is the head."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "| --- " * len(rows[0]) + "|", *lines[1:]]) + "\n"


def limits_in_words(limit: str | float) -> str:
    """A torque limit as `retarget` takes it."""
    return limit if isinstance(limit, str) else f"{limit:g} Nm"


def yes(value: bool) -> str:
    """As a table says it."""
    return "yes" if value else "no"


def ankles(run: Run, q: Array) -> Array:
    """Heights (T, 2), m, of the ankles of a motion q (T, 57)."""
    joints = kinematics.joint_positions(run.character(), q)
    return joints[:, [skeleton.INDEX["left_ankle"], skeleton.INDEX["right_ankle"]], 2]


def sheet(rows: Sequence[Row], n: int = 9) -> Picture:
    """A strip of n frames for each run, with its name."""
    return strip([scene(*row) for row in rows], n)


def scene(label: str, run: Run, q: Array, azimuth: float = AZIMUTH) -> Scene:
    """The person of a run in the motion q (T, 57)."""
    actor = make_actor(surface(run, capsules=run.mesh is None), q, label=label)
    return stage([actor], 1.0 / run.timestep, PANEL, azimuth=azimuth)

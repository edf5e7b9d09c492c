"""Table 2: how large an impulse PD and LQR stand, in 0.8 s of standing balance.

    python -m physique.experiments.table2 --out out/table2

An impulse on a random part in a random direction, on the first time step.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tyro.conf import arg

from physique import rotations, skeleton
from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.commands.push import PushReport, push
from physique.commands.retarget import retarget
from physique.commands.stabilize import stabilize
from physique.motion.clip import Motion
from physique.store import prepare_folder, write_atomic

IMPULSES = (5.0, 50.0, 75.0, 125.0, 250.0)  # Ns
PAPER = {"pd": (3, 4, 0, 1, 0), "lqr": (89, 28, 20, 8, 5)}  # of 100 trials
SECONDS = 0.8
FPS = 100.0


@dataclass(frozen=True)
class Table2:
    """Push a standing body and compare with the paper's Table 2.

    Args:
        out: the folder for the run and the table
        trials: of each impulse
        duration: of a push, seconds; the paper's first time step if left out
        seed: of the pushes
        body: a ready body or a body file
    """

    out: Annotated[Path, arg(metavar="DIR")] = Path("out/table2")
    trials: int = 100
    duration: float = 0.01
    seed: int = 0
    body: str = "average"


def standing(body: str) -> Motion:
    """0.8 s of standing upright with the arms down."""
    rest = capsule_body(named_body(body)).joints
    turn = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (22, 1))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        turn[skeleton.INDEX[f"{side}_shoulder"]] = rotations.about("x", np.array(sign * 1.2))
    frames = round(SECONDS * FPS) + 1
    return Motion(
        name="standing",
        source="physique.experiments.table2",
        fps=FPS,
        rotations=np.tile(turn, (frames, 1, 1)),
        root=np.tile(rest[0], (frames, 1)),
        rest_joints=rest,
        contacts=np.ones((frames, 2), dtype=bool),
    )


def measure(options: Table2) -> dict[str, list[PushReport]]:
    """Survival of each controller at each impulse."""
    folder = prepare_folder(options.out) / "standing"
    retarget(standing(options.body), options.body, out=folder, overwrite=True)
    stabilize(folder)
    found: dict[str, list[PushReport]] = {}
    for controller in ("pd", "lqr"):
        found[controller] = [
            push(
                folder,
                impulse,
                duration=options.duration,
                trials=options.trials,
                seed=options.seed,
                controller=controller,
                start=0.0,
                end=0.0,
            )[0]
            for impulse in IMPULSES
        ]
    return found


def table(found: dict[str, list[PushReport]]) -> str:
    """A table in Markdown, percent survived."""
    head = "| impulse, Ns | " + " | ".join(f"{i:g}" for i in IMPULSES) + " |"
    speed = "| delta-v, m/s | " + " | ".join(f"{r.delta_v:.2f}" for r in found["lqr"]) + " |"
    rows = [head, "| --- |" + " ---: |" * len(IMPULSES), speed]
    for name, reports in found.items():
        ours = " | ".join(f"{100 * r.survival:.0f}" for r in reports)
        rows += [
            f"| {name.upper()}, % | {ours} |",
            f"| {name.upper()} in the paper, % | " + " | ".join(map(str, PAPER[name])) + " |",
        ]
    return "\n".join(rows) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and store the table."""
    options = tyro.cli(Table2, args=arguments)
    text = table(measure(options))
    write_atomic(options.out / "table2.md", text.encode())
    sys.stdout.write(text)


if __name__ == "__main__":
    main()

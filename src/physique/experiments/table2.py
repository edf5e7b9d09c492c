"""Table 2: how large an impulse PD and LQR stand, in 0.8 s of standing balance.

    python -m physique.experiments.table2 --out out/table2

An impulse on a random part in a random direction, on the first time step. Takes some minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import arg

from physique.commands.push import PushReport, push
from physique.commands.retarget import retarget
from physique.commands.stabilize import stabilize
from physique.experiments.standing import standing
from physique.store import prepare_folder, write_atomic

IMPULSES = (5.0, 50.0, 75.0, 125.0, 250.0)  # Ns
PAPER = {"pd": (3, 4, 0, 1, 0), "lqr": (89, 28, 20, 8, 5)}  # of 100 trials


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

"""Table 1: perturbed states and nodes of the subtrees of a boxing-like clip.

    python -m physique.experiments.table1 out/boxing

Grows the paper's tree (h = 0.1 s, F = 50, 100, 150 N) about the motion of a run, into its folder: with
the paper's 100 trials a quarter of an hour or more. What is grown is stored round by round; stopped,
it goes on with --resume.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import Positional, arg

from physique.commands.grow import grow_tree
from physique.feedback.grow import Settings
from physique.store import write_atomic

FORCES = (50.0, 100.0, 150.0)  # N
#: Timestep: perturbed states, nodes. The paper's clip has 230 steps.
PAPER = {230: (7, 140), 220: (9, 180), 210: (5, 100), 200: (17, 180), 190: (11, 220), 180: (4, 80)}


@dataclass(frozen=True)
class Table1:
    """Grow the paper's tree and compare it with Table 1.

    Args:
        run: the folder of a finished run of a clip of 2.3 s or more
        trials: of each force at each subtree; the paper has 100
        workers: processes
        seed: of the pushes
        resume: go on with a growth that was stopped
        overwrite: replace the tree that is there
    """

    run: Annotated[Positional[Path], arg(metavar="RUN")]
    trials: int = 100
    workers: int | None = None
    seed: int = 0
    resume: bool = False
    overwrite: bool = False


def table(tree: dict[str, Any]) -> str:
    """A table in Markdown: our subtrees from the motion's end on, beside the paper's."""
    rows = [
        "| timestep | perturbed states | nodes | the paper's timestep | states | nodes |",
        "| ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    paper = iter(PAPER.items())
    for subtree in tree["subtrees"]:
        step, (states, nodes) = next(paper, ("", ("", "")))
        rows.append(
            f"| {subtree['timestep']} | {subtree['perturbed_states']} | {subtree['nodes']} "
            f"| {step} | {states} | {nodes} |"
        )
    return "\n".join(rows) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """Grow, print and store the table."""
    options = tyro.cli(Table1, args=arguments)
    settings = Settings(forces=FORCES, trials=options.trials, seed=options.seed)
    tree = grow_tree(
        options.run, settings, workers=options.workers, resume=options.resume, overwrite=options.overwrite
    )
    text = table(tree)
    write_atomic(options.run / "table1.md", text.encode())
    sys.stdout.write(text)
    sys.stdout.write(f"{tree['sim_steps']:,} simulated steps, {tree['seconds']:.0f} s\n")


if __name__ == "__main__":
    main()

"""The two connectors of the tree on the same perturbed states: derivatives, and CMA as published.

    python benchmarks/compare_connectors.py out/punch --states 8

States that the motion alone does not stand after a push of 0.1 s: how many each connector
leads back, in how many simulated steps. A branch must end where the motion's controllers go on to
its end. A state takes CMA about a minute. Each is stored in the run's folder (connectors.json) as it
ends: stopped, it goes on where it was, and states that the present code led back are not led again.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from tyro.conf import Positional, arg

from physique.experiments.cells import Cells
from physique.feedback import cma_connect, connect
from physique.feedback.choice import DEFAULT, ZETA, Chooser
from physique.feedback.connect import Trunk, make_trunk
from physique.feedback.growth import root
from physique.feedback.law import BOUND, Law
from physique.feedback.pushes import random_pushes
from physique.feedback.tree import Tree, grown
from physique.runs.run import load_run
from physique.simulation.closed_loop import Servo
from physique.simulation.linear_feedback import Feedback
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.simulation.stepper import Push

CONNECTORS = ("derivatives", "CMA")


@dataclass(frozen=True)
class Options:
    """Compare the connectors on the motion of a run.

    Args:
        run: the folder of a finished run
        states: that are to be led back
        impulse: of the pushes, Ns
        seed: of the pushes
    """

    run: Annotated[Positional[Path], arg(metavar="RUN")]
    states: int = 8
    impulse: float = 50.0
    seed: int = 0


def main() -> None:
    """Compare and print a table in Markdown."""
    options = tyro.cli(Options)
    run = load_run(options.run)
    character, motion = run.character(), run.trajectory
    cells = Cells(options.run / "connectors.json")
    inputs = {"run": run.record["identity"], "impulse": options.impulse, "seed": options.seed}
    rows: list[dict[str, Any]] = []
    with quiet(), MujocoSimulator(character, 1) as simulator:
        trunk = make_trunk(simulator, motion.q, motion.v, motion.control)
        for number in itertools.count():
            if len(rows) == options.states:
                break
            rng = np.random.default_rng([options.seed, number])
            work = partial(compare, simulator, trunk, options.impulse, rng)
            row = cells.make(f"push {number}", work, **inputs)
            if row is not None:
                rows.append(row)
                print(row, flush=True)
    print("| connector | led back | simulated steps a state | processor seconds a state |")
    print("| --- | ---: | ---: | ---: |")
    for name in CONNECTORS:
        good, steps, seconds = np.array([row[name] for row in rows], dtype=float).T
        print(f"| {name} | {good.mean():.0%} | {steps.mean():,.0f} | {seconds.mean():.1f} |")


def compare(
    simulator: MujocoSimulator, trunk: Trunk, impulse: float, rng: np.random.Generator
) -> dict[str, Any] | None:
    """Where a push leads, and of each connector whether it leads back from there, its simulated
    steps and seconds of the processor; None where the motion alone stands the push."""
    character, tree = simulator.character, root(trunk)
    law = Feedback(character, trunk.q, trunk.v, trunk.control, trunk.gains, BOUND)
    push = random_pushes(rng, 1, impulse, 10, (0, trunk.last - 150), 0.01)[0]
    moved = simulator.perform(
        trunk.q[push.start],
        trunk.v[push.start],
        10,
        lambda t, q, v: law(push.start + t, q, v),
        Push(push.part, push.force, 0, 10),
    )
    q, v, at = moved.q[-1], moved.v[-1], push.start + 10

    def leads_back(grown_tree: Tree) -> bool:
        chooser = Chooser(Law(Servo(character.xml), grown_tree), DEFAULT, 1)
        return bool(chooser.choose(q, v, at).loss < ZETA)

    if leads_back(tree):
        return None
    row: dict[str, Any] = {"push": f"{push.name} at {push.start / 100:.2f} s"}
    for name in CONNECTORS:
        before, clock = simulator.steps, time.process_time()
        if name == "CMA":
            branch = cma_connect.connect(simulator, trunk, tree, q, v, at, rng)
        else:
            branch = connect.connect(simulator, trunk, q, v, at)
        price = [simulator.steps - before, time.process_time() - clock]
        row[name] = [branch is not None and leads_back(grown(tree, [branch])), *price]
    return row


if __name__ == "__main__":
    main()

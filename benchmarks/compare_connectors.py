"""The two connectors of the tree on the same perturbed states: derivatives, and CMA as published.

    python benchmarks/compare_connectors.py out/punch --states 8

States that the motion alone does not stand after a push of 0.1 s: how many each connector
leads back, in how many simulated steps. A branch must end where the motion's controllers go on to
its end.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tyro.conf import Positional, arg

from physique.feedback import cma_connect, connect
from physique.feedback.choice import DEFAULT, ZETA, Chooser
from physique.feedback.connect import make_trunk
from physique.feedback.growth import root
from physique.feedback.law import BOUND
from physique.feedback.pushes import random_pushes
from physique.feedback.tree import grown
from physique.runs.run import load_run
from physique.simulation.closed_loop import Servo
from physique.simulation.disturb import Push, simulate_pushed
from physique.simulation.quiet import quiet
from physique.simulation.rollout import Feedback
from physique.simulation.simulator import Simulator


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
    rng = np.random.default_rng(options.seed)
    rows = []
    with quiet(), Simulator(character, 1) as simulator:
        trunk = make_trunk(simulator, motion.q, motion.v, motion.control)
        tree = root(trunk)
        law = Feedback(character, trunk.q, trunk.v, trunk.control, trunk.gains, BOUND)
        chooser = Chooser(Servo(character.xml), tree, DEFAULT, 1)
        while len(rows) < options.states:
            push = random_pushes(rng, 1, options.impulse, 10, (0, trunk.last - 150), 0.01)[0]
            moved = simulate_pushed(
                character,
                trunk.q[push.start],
                trunk.v[push.start],
                10,
                lambda t, q, v, first=push.start: law(first + t, q, v),
                Push(push.part, push.force, 0, 10),
            )
            q, v, at = moved.q[-1], moved.v[-1], push.start + 10
            if chooser.choose(q, v, at).loss < ZETA:
                continue
            row = []
            for name in ("derivatives", "CMA"):
                before, clock = simulator.steps, time.process_time()
                if name == "CMA":
                    branch = cma_connect.connect(simulator, trunk, tree, q, v, at, rng)
                else:
                    branch = connect.connect(simulator, trunk, q, v, at)
                price = simulator.steps - before, time.process_time() - clock
                good = False
                if branch is not None:
                    whole = Chooser(Servo(character.xml), grown(tree, [branch]), DEFAULT, 1)
                    good = whole.choose(q, v, at).loss < ZETA
                row.append((good, *price))
            rows.append(row)
            print(f"{push.name} at {push.start / 100:.2f} s: {row}", flush=True)
    print("| connector | led back | simulated steps a state | processor seconds a state |")
    print("| --- | ---: | ---: | ---: |")
    for number, name in enumerate(("derivatives", "CMA")):
        good, steps, seconds = np.array([row[number] for row in rows], dtype=float).T
        print(f"| {name} | {good.mean():.0%} | {steps.mean():,.0f} | {seconds.mean():.1f} |")


if __name__ == "__main__":
    main()

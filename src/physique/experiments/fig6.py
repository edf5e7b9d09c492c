"""Fig. 6: 500 N for 0.1 s on the kicking foot, under LQR and under the tree.

    python -m physique.experiments.fig6 out/kick

Needs a run of a kick with a grown tree. The push comes when one foot is highest, from the side.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from tyro.conf import Positional, arg

from physique import skeleton
from physique.character import kinematics
from physique.commands.bodies import write_png
from physique.feedback.policy import ControllerName
from physique.feedback.pushes import Trial, run_trial
from physique.render.picture import animation, strip
from physique.runs.run import load_run
from physique.simulation.disturb import Push
from physique.simulation.quiet import quiet

DURATION = 0.1  # s
PANELS = 8


@dataclass(frozen=True)
class Fig6:
    """Push the kicking foot and draw what LQR and the tree make of it.

    Args:
        run: the folder of a run whose policy has a tree
        side: from which the foot is pushed
        at: s, when; when a foot is highest if left out
        force: N; the paper's is 500
    """

    run: Annotated[Positional[Path], arg(metavar="RUN")]
    side: Literal["left", "right"] = "left"
    at: float | None = None
    force: float = 500.0


def kicking_foot(joints: np.ndarray, timestep: float, at: float | None) -> tuple[int, int]:
    """The joint of the foot that is highest in joints (T, 22, 3), and the frame, or at s."""
    feet = [skeleton.INDEX[f"{side}_ankle"] for side in ("left", "right")]
    height = joints[:, feet, 2]
    frame = int(height.max(axis=1).argmax()) if at is None else round(at / timestep)
    return feet[int(height[frame].argmax())], frame


def main(arguments: list[str] | None = None) -> None:
    """Push, draw, and say who survived."""
    options = tyro.cli(Fig6, args=arguments)
    run = load_run(options.run)
    character = run.character()
    step = float(character.model.opt.timestep)
    joints = kinematics.joint_positions(character, run.trajectory.q)
    part, frame = kicking_foot(joints, step, options.at)
    sign = -1.0 if options.side == "left" else 1.0
    push = Push(part, (0.0, sign * options.force, 0.0), frame, round(DURATION / step))
    names: tuple[ControllerName, ...] = ("lqr", "tree")
    found: dict[str, Trial] = {}
    for name in names:
        policy = run.policy(name)
        with quiet():
            found[name] = run_trial(character, policy, push, joints, to_end=True)
    wanted = run.trajectory.q[frame:]
    rows = []
    for label, trial in found.items():
        q = trial.motion.q
        rows.append(
            strip(
                character.model,
                q,
                PANELS,
                fps=1 / step,
                reference_q=wanted[: len(q)],
                panel=(150, 210),
                labels=("motion", label),
            )
        )
        animation(character.model, q, 1 / step, options.run / f"fig6_{label}.webp", wanted[: len(q)])
        outcome = "recovers" if trial.lost is None else f"is lost after {trial.lost:.2f} s"
        sys.stdout.write(f"{label}: {outcome}, greatest error {trial.error:.2f} m\n")
    write_png(options.run / "fig6.png", np.concatenate(rows))
    sys.stdout.write(f"{push.name} at {frame * step:.2f} s: {options.run / 'fig6.png'}\n")


if __name__ == "__main__":
    main()

"""Fig. 6: 500 N for 0.1 s on the kicking foot, under LQR and under the tree.

    python -m physique.experiments.fig6 out/kick

Needs a run of a kick with a grown tree; takes a minute. The push comes when one foot is highest,
from the side.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
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
from physique.render import palette
from physique.render.picture import animation, strip
from physique.render.raster import Image
from physique.render.scene import Actor, make_actor, stage
from physique.render.surface import surface
from physique.runs.run import Run, load_run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.simulation.stepper import Push

DURATION = 0.1  # s
PANEL, PANELS = (220, 210), 6  # pixels of a frame; frames


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


def pushed_actors(run: Run, trials: Mapping[str, Trial], start: int) -> tuple[Actor, list[Actor]]:
    """The run from frame `start` on, as a ghost, and what controllers made of a push then."""
    capsules = run.mesh is None
    shown = surface(run, capsules=capsules)
    wanted = run.trajectory.q[start:]
    ghost = make_actor(shown, wanted, label="motion", ghost=True, colour=palette.SOURCE)
    actors = []
    for index, (label, trial) in enumerate(trials.items()):
        shown = surface(run, capsules=capsules, colour=palette.body(index))
        actors.append(make_actor(shown, trial.motion.q, label=label))
    return ghost, actors


def pushed_strip(ghost: Actor, actors: Sequence[Actor], fps: float) -> Image:
    """A row of pictures for each controller, beside the ghost."""
    return strip([stage([ghost, actor], fps, PANEL) for actor in actors], PANELS)


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
        with quiet(), MujocoSimulator(character, 1) as simulator:
            found[name] = run_trial(simulator, policy, push, joints, to_end=True)
    for label, trial in found.items():
        outcome = "recovers" if trial.lost is None else f"is lost after {trial.lost:.2f} s"
        sys.stdout.write(f"{label}: {outcome}, greatest error {trial.error:.2f} m\n")
    wanted, actors = pushed_actors(run, found, frame)
    write_png(options.run / "fig6.png", pushed_strip(wanted, actors, 1 / step))
    animation(options.run / "fig6.webp", stage([wanted, *actors], 1 / step))
    sys.stdout.write(f"{push.name} at {frame * step:.2f} s: {options.run / 'fig6.png'}\n")


if __name__ == "__main__":
    main()

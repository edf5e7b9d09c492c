"""A recovery step: a push that the tree survives by stepping aside, and LQR does not.

    python -m physique.experiments.recovery out/boxing

Needs a run with a grown tree. Pushes it at random until such a push is found, then draws both: some
minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray
from tyro.conf import Positional, arg

from physique import skeleton
from physique.character import kinematics
from physique.commands.bodies import write_png
from physique.commands.push import MARGIN
from physique.errors import InputError
from physique.experiments.fig6 import pushed_actors, pushed_strip
from physique.export.video import encode
from physique.feedback.policy import ControllerName
from physique.feedback.pushes import Trial, random_pushes, run_trial
from physique.render.sampling import RATE, frames_at
from physique.render.scene import stage
from physique.runs.run import Run, load_run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet

Array = NDArray[np.float64]

#: A foot that has come down this far from where it should be has made a step of its own.
LEAST = 0.10  # m
#: A foot stands where its toes are slower than this, m/s, for so long, s, and lower than in a step
#: by so much, m.
SLOW, STANDS, LIFT = 0.25, 0.08, 0.03
DURATION = 0.1  # s, of a push


@dataclass(frozen=True)
class Recovery:
    """Find a push that is survived by a recovery step, and draw it.

    Args:
        run: the folder of a run whose policy has a tree
        impulse: of the pushes, newton seconds
        seed: of the pushes
        trials: pushes that are tried at most
    """

    run: Annotated[Positional[Path], arg(metavar="RUN")]
    impulse: float = 50.0
    seed: int = 0
    trials: int = 60


@dataclass(frozen=True)
class Step:
    """A foot comes down at `frame` since the push, `length` m from where it should be then."""

    foot: str
    frame: int
    length: float


def longest_step(joints: Array, wanted: Array, timestep: float) -> Step | None:
    """The longest step that the motion (T, 22, 3), m, does not have: a foot is lifted and set down
    at least `LEAST` from where it stands in the wanted one at that time. None without one.

    A foot that slides there has not stepped.
    """
    steps = []
    for side in ("left", "right"):
        toes = skeleton.INDEX[f"{side}_foot"]
        stands, should = (_stands(at[:, toes], timestep) for at in (joints, wanted))
        aside = np.linalg.norm((joints - wanted)[:, toes, :2], axis=1)
        height = joints[:, toes, 2]
        for start in np.flatnonzero(np.diff(stands.astype(int)) == 1) + 1:
            before = np.flatnonzero(stands[:start])
            swing = height[before[-1] if len(before) else 0 : start]
            end = start + int(np.argmin(np.append(stands[start:], False)))
            both = np.flatnonzero(should[start:end])
            if len(both) and swing.max() - height[start:end].min() > LIFT:
                steps.append(Step(side, int(start), float(aside[start + both].min())))
    best = max(steps, key=lambda step: step.length, default=None)
    return best if best is not None and best.length >= LEAST else None


def _stands(at: Array, timestep: float) -> NDArray[np.bool_]:
    """Whether a foot with its toes at (T, 3), m, stands; it must do so for `STANDS`."""
    slow = np.linalg.norm(np.gradient(at, timestep, axis=0), axis=1) < SLOW
    low = at[:, 2] < at[:, 2].min() + LIFT
    width = round(STANDS / timestep)
    long = np.convolve(slow & low, np.ones(width), mode="full")[: len(at)] >= width
    return np.array([long[t : t + width].any() for t in range(len(at))])


def find(options: Recovery, run: Run) -> tuple[Step, dict[str, Trial]]:
    """The first push that is survived by a step of the tree's, and what came of it by controller.

    Raises InputError where there is none among the trials.
    """
    names: tuple[ControllerName, ...] = ("lqr", "tree")
    policies = {name: run.policy(name) for name in names}
    timestep, seconds = policies["lqr"].timestep, policies["lqr"].seconds
    pushes = random_pushes(
        np.random.default_rng(options.seed),
        options.trials,
        options.impulse,
        round(DURATION / timestep),
        (0, round(max(0.0, seconds - MARGIN) / timestep)),
        timestep,
    )
    character = run.character()
    joints = kinematics.joint_positions(character, run.trajectory.q)
    with MujocoSimulator(character, 1) as simulator:
        for push in pushes:
            trials: dict[str, Trial] = {}
            for name, policy in policies.items():
                trials[name] = run_trial(simulator, policy, push, joints, to_end=name == "lqr")
                if trials[name].survived != (name == "tree"):
                    break
            else:
                step = longest_step(trials["tree"].joints, joints[push.start :], timestep)
                if step is not None:
                    return step, trials
    raise InputError(
        str(options.run),
        f"no recovery step in {options.trials} pushes of {options.impulse:g} Ns",
        "one",
        "try another --seed, --impulse or more --trials",
    )


def draw(run: Run, trials: dict[str, Trial], folder: Path) -> tuple[Path, Path]:
    """A strip of pictures and a video of both controllers, from the push on."""
    fps = 1 / run.timestep
    ghost, actors = pushed_actors(run, trials, trials["tree"].push.start)
    write_png(folder / "recovery.png", pushed_strip(ghost, actors, fps))
    scene = stage(actors, fps)
    frames = frames_at(scene.frames, scene.fps, RATE).tolist()
    video = encode(folder / "recovery.mp4", scene.pictures(frames), scene.size, RATE)
    return folder / "recovery.png", video


def main(arguments: list[str] | None = None) -> None:
    """Find a recovery step, draw it, and say what it is."""
    options = tyro.cli(Recovery, args=arguments)
    run = load_run(options.run)
    with quiet():
        step, trials = find(options, run)
    push = trials["tree"].push
    for path in draw(run, trials, options.run):
        sys.stdout.write(f"{path}\n")
    sys.stdout.write(
        f"{options.impulse:g} Ns on the {push.name} at {push.start * run.timestep:.2f} s: "
        f"lqr is lost after {trials['lqr'].lost:.2f} s; with the tree "
        f"the {step.foot} foot comes down {step.length:.2f} m from its place "
        f"{step.frame * run.timestep:.2f} s after the push\n"
    )


if __name__ == "__main__":
    main()

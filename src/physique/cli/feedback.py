"""The commands that give a run feedback, and try it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from physique.cli import console, progress
from physique.cli.options import SECONDS, Flag, left_out
from physique.errors import InputError


@dataclass(frozen=True)
class StabilizeCommand:
    """Add feedback to a run: policy.npz, LQR along its motion.

    Args:
        run_folder: the folder of a finished run
        weights: default survives most; paper is section 4.1
        overwrite: replace another policy, with its tree
    """

    run_folder: Annotated[Positional[Path], arg(metavar="RUN")]
    weights: Literal["default", "paper"] = "default"
    overwrite: Flag = False

    def run(self) -> None:
        """Stabilise and say where the policy is."""
        from physique.commands.stabilize import stabilize
        from physique.runs.run import POLICY

        stabilize(self.run_folder, self.weights, overwrite=self.overwrite)
        console.show_files([self.run_folder / POLICY])


@dataclass(frozen=True)
class GrowCommand:
    """Grow a tree of feedback controllers about a run's motion, into its policy.npz.

    Args:
        run_folder: the folder of a finished run
        interval: seconds between subtrees
        forces: greatest force of each turn of random pushes of 0.1 s, newtons, with commas
        trials: pushes of each force at each subtree
        parts: of the body that are pushed, with commas
        workers: processes; they do not change the tree
        seed: of the pushes
        connector: fast uses derivatives of the simulator; paper is CMA as published, and slow
        weights: of the feedback, as for stabilize
        resume: go on with a growth that was stopped
        overwrite: replace the tree that is there
    """

    run_folder: Annotated[Positional[Path], arg(metavar="RUN")]
    interval: Annotated[float, SECONDS, arg(metavar="SECONDS")] = 0.1
    forces: Annotated[str, arg(metavar="N,N,N")] = "150,300,500"
    trials: Annotated[int, arg(metavar="COUNT")] = 8
    parts: Annotated[str | None, left_out("NAME,NAME", "all 22")] = None
    workers: Annotated[int | None, left_out("COUNT", "as many as the machine has")] = None
    seed: int = 0
    connector: Literal["fast", "paper"] = "fast"
    weights: Annotated[
        Literal["default", "paper"] | None, left_out("default|paper", "those of the policy that is there")
    ] = None
    resume: Flag = False
    overwrite: Flag = False

    def run(self) -> None:
        """Grow it and show what it is like."""
        from physique.commands.grow import grow_tree
        from physique.feedback.grow import Settings

        settings = Settings(
            self.interval,
            _numbers("--forces", self.forces),
            self.trials,
            self.seed,
            self.connector,
            parts=tuple(self.parts.split(",")) if self.parts else (),
        )
        with progress.growth(str(self.run_folder)) as report:
            tree = grow_tree(
                self.run_folder,
                settings,
                weights=self.weights,
                workers=self.workers,
                resume=self.resume,
                overwrite=self.overwrite,
                progress=report,
            )
        console.show_tree(tree)


@dataclass(frozen=True)
class PushCommand:
    """Push a run's character at random, and count how often it keeps performing the motion.

    Args:
        run_folder: the folder of a stabilised run
        impulse: of each push, newton seconds
        duration: of each push, seconds
        trials: pushes, one a trial
        seed: of the pushes
        controller: pd has no feedback, lqr follows the motion, tree looks for the best node
        from_: earliest time of a push, in seconds
        to: latest time of a push, in seconds
        json: print JSON instead of a table
    """

    run_folder: Annotated[Positional[Path], arg(metavar="RUN")]
    impulse: Annotated[float, arg(metavar="NS")]
    duration: Annotated[float, SECONDS, arg(metavar="SECONDS")] = 0.1
    trials: Annotated[int, arg(metavar="COUNT")] = 100
    seed: int = 0
    controller: Annotated[
        Literal["pd", "lqr", "tree"] | None, left_out("pd|lqr|tree", "the tree where there is one, else lqr")
    ] = None
    from_: Annotated[
        float | None,
        SECONDS,
        arg(metavar="SECONDS", name="from", help_behavior_hint="(default: the beginning)"),
    ] = None
    to: Annotated[float | None, SECONDS, left_out("SECONDS", "1.5 s before the end")] = None
    json: Flag = False

    def run(self) -> None:
        """Push it and show how it stood that."""
        from physique.commands.push import push

        with progress.counting(f"pushing {self.run_folder}", self.trials) as on_trial:
            report, _ = push(
                self.run_folder,
                self.impulse,
                duration=self.duration,
                trials=self.trials,
                seed=self.seed,
                controller=self.controller,
                start=self.from_,
                end=self.to,
                on_trial=on_trial,
            )
        console.show_pushes(report, self.json)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            option, repr(text), "numbers with commas between them", "write for instance 50,100,150"
        ) from None

"""The commands that list and make what the others use: bodies, clips, runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg

from physique.cli import console, progress
from physique.cli.options import HEIGHT, MASS, SECONDS, Flag, Threads, left_out


@dataclass(frozen=True)
class BodiesCommand:
    """List the ready bodies."""

    def run(self) -> None:
        """Print them."""
        from physique.body.named import PEOPLE

        rows = [
            (name, p.sex, f"{p.height:.2f}", f"{p.mass:.1f}", p.description) for name, p in PEOPLE.items()
        ]
        console.table(("body", "sex", "height m", "mass kg", "who"), rows)


@dataclass(frozen=True)
class ClipsCommand:
    """List the embedded clips."""

    def run(self) -> None:
        """Print them."""
        from physique.motion.library import list_clips

        rows = [(c.name, f"{c.seconds:.2f}", f"{c.fps:.1f}", c.origin) for c in list_clips()]
        console.table(("clip", "seconds", "fps", "origin"), rows)


@dataclass(frozen=True)
class BodyCommand:
    """Make the body of a person, say how well capsules stand for it, and store it.

    Args:
        name: a ready body (see `physique bodies`) or a body file; or describe the person
        sex: of the person
        height: stature, such as 1.63m, 178cm or 5ft10; a bare number is metres
        mass: such as 72kg or 160lb; a bare number is kg
        json: print JSON instead of a table
        out: write the body to this file
        picture: draw the body and its capsules into this file
    """

    name: Annotated[Positional[str | None], left_out("[NAME]")] = None
    sex: Annotated[Literal["male", "female"] | None, left_out("male|female", "male")] = None
    height: Annotated[float | None, HEIGHT, left_out("HEIGHT", "1.75m")] = None
    mass: Annotated[float | None, MASS, left_out("MASS", "75kg")] = None
    json: Flag = False
    out: Annotated[Path | None, left_out("FILE.npz")] = None
    picture: Annotated[Path | None, left_out("FILE.png")] = None

    def run(self) -> None:
        """Make, store and show it."""
        from physique.commands.bodies import choose_body, picture_body, write_body

        made = choose_body(self.name, sex=self.sex, height=self.height, mass=self.mass)
        if self.out is not None:
            write_body(self.out, made)
        if self.picture is not None:
            picture_body(self.picture, made)
        console.show_facts(made.facts(), self.json)


@dataclass(frozen=True)
class RetargetCommand:
    """Make a body perform a clip under physics.

    Exit code 0 also where the body could not follow: that is a result, see metrics.json.

    Args:
        clip: a .bvh or .amc file, or an embedded clip (see `physique clips`)
        body: a ready body (see `physique bodies`) or a body file
        out: the folder for the results
        fps: the recording's true frames a second, where its header is wrong
        start: begin of the part to perform, s
        end: end of the part to perform, s
        optimizer: fast uses derivatives of the simulator; paper is CMA as published, and slow
        torque_limit: body, for limits that fit mass and stature, or Nm for all joints
        horizon: what each window looks ahead, s
        weights: of the cost: paper is section 3.1, default the same with a stiller spine
        weight: weight of a term of the cost: com, com_velocity, pose, velocity, root or
            acceleration; once for each term
        hold: an object: stick or block, mass and, if wanted, size, such as stick:2.0kg (1 m long),
            stick:2.0kg:1.2m, block:5kg (a cube of 0.2 m) or block:5kg:0.3m
        hand: that holds it; both is one such object in each hand
        seed: of all random draws
        mapping: names the joints of a skeleton that is not recognised (docs/motion.md)
        threads: that simulate; they do not change the result
        resume: go on with the run in the folder, which was stopped
        overwrite: replace the run in the folder
    """

    clip: Annotated[Positional[str], arg(metavar="CLIP")]
    body: Annotated[str, arg(metavar="NAME|FILE.npz")]
    out: Annotated[Path, arg(metavar="DIR")]
    fps: Annotated[float | None, left_out("NUMBER", "as the header says")] = None
    start: Annotated[float | None, SECONDS, left_out("SECONDS", "the clip's begin")] = None
    end: Annotated[float | None, SECONDS, left_out("SECONDS", "the clip's end")] = None
    optimizer: Literal["fast", "paper"] = "fast"
    torque_limit: Annotated[Literal["body"] | float, arg(metavar="body|NM")] = "body"
    horizon: Annotated[float | None, SECONDS, left_out("SECONDS", "0.8")] = None
    weights: Annotated[
        Literal["default", "paper"] | None, left_out("default|paper", "default, paper for that optimizer")
    ] = None
    weight: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME=NUMBER", help_behavior_hint="(default: as --weights; repeatable)"),
    ] = ()
    hold: Annotated[str | None, left_out("SHAPE:MASS[:SIZE]", "empty hands")] = None
    hand: Annotated[Literal["right", "left", "both"] | None, left_out("right|left|both", "right")] = None
    seed: Annotated[int, arg(metavar="NUMBER")] = 0
    mapping: Annotated[Path | None, left_out("FILE.toml")] = None
    threads: Threads = None
    resume: Flag = False
    overwrite: Flag = False

    def run(self) -> None:
        """Retarget and show the metrics."""
        with progress.tracking(f"{self.clip} on {self.body}") as report:
            from physique.commands.inputs import find_held, parse_weights
            from physique.commands.retarget import own_weights, retarget

            paper = (self.weights or self.optimizer) == "paper"
            base = own_weights("paper" if paper else "fast")
            run = retarget(
                self.clip,
                self.body,
                fps=self.fps,
                start=self.start,
                end=self.end,
                mapping=self.mapping,
                optimizer=self.optimizer,
                torque_limit=self.torque_limit,
                horizon=self.horizon,
                weights=parse_weights(self.weight, base),
                hold=find_held(self.hold, self.hand),
                seed=self.seed,
                threads=self.threads,
                out=self.out,
                resume=self.resume,
                overwrite=self.overwrite,
                progress=report,
            )
        console.show_runs([run])


@dataclass(frozen=True)
class DemoCommand:
    """Retarget an embedded clip onto two ready bodies, with pictures.

    Args:
        out: the folder for the results; a demo that is there is replaced
        threads: that simulate; they do not change the result
    """

    out: Annotated[Path, arg(metavar="DIR")] = Path("out/demo")
    threads: Threads = None

    def run(self) -> None:
        """Run and show it."""
        with progress.tracking("demo") as report:
            from physique.commands.demo import run_demo

            result = run_demo(self.out, threads=self.threads, progress=report)
        console.show_runs(result.runs)
        console.show_files(result.pictures)

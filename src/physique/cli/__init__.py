"""The command `physique`: each subcommand calls one stage of the library and shows its result.

The library is imported by the commands that need it, so that `--help` comes at once.
"""

from __future__ import annotations

import contextlib
import io
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import FlagCreatePairsOff, Positional, UseAppendAction, arg

from physique.cli import console
from physique.errors import InputError


def left_out(metavar: str, what: str | None = None) -> object:
    """How an option is shown whose default is None: what happens then, if that is to be said."""
    return arg(metavar=metavar, help_behavior_hint=f"(default: {what})" if what else "(optional)")


Flag = Annotated[bool, arg(help_behavior_hint="")]
Runs = Annotated[Positional[tuple[Path, ...]], arg(metavar="RUN [RUN ...]", help_behavior_hint="(required)")]
Threads = Annotated[int | None, left_out("COUNT", "as many as the machine has, at most 8")]


@dataclass(frozen=True)
class Bodies:
    """List the ready bodies."""

    def run(self) -> None:
        """Print them."""
        from physique.body.named import PEOPLE

        rows = [
            (name, p.sex, f"{p.height:.2f}", f"{p.mass:.1f}", p.description) for name, p in PEOPLE.items()
        ]
        console.table(("body", "sex", "height m", "mass kg", "who"), rows)


@dataclass(frozen=True)
class Clips:
    """List the embedded clips."""

    def run(self) -> None:
        """Print them."""
        from physique.motion.library import list_clips

        rows = [(c.name, f"{c.seconds:.2f}", f"{c.fps:.1f}", c.origin) for c in list_clips()]
        console.table(("clip", "seconds", "fps", "origin"), rows)


@dataclass(frozen=True)
class Body:
    """Make the body of a person, say how well capsules stand for it, and store it.

    Args:
        name: a ready body (see `physique bodies`) or a body file; or describe the person
        sex: of the person
        height: stature, m
        mass: kg
        json: print JSON instead of a table
        out: write the body to this file
        picture: draw the body and its capsules into this file
    """

    name: Annotated[Positional[str | None], left_out("[NAME]")] = None
    sex: Annotated[Literal["male", "female"] | None, left_out("male|female", "male")] = None
    height: Annotated[float | None, left_out("METRES", "1.75")] = None
    mass: Annotated[float | None, left_out("KG", "75")] = None
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
class Retarget:
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
    start: Annotated[float | None, left_out("SECONDS", "the clip's begin")] = None
    end: Annotated[float | None, left_out("SECONDS", "the clip's end")] = None
    optimizer: Literal["fast", "paper"] = "fast"
    torque_limit: Annotated[Literal["body"] | float, arg(metavar="body|NM")] = "body"
    horizon: Annotated[float | None, left_out("SECONDS", "0.8")] = None
    weight: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME=NUMBER", help_behavior_hint="(default: the paper's; repeatable)"),
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
        from physique.commands.inputs import find_held, parse_weights
        from physique.commands.retarget import retarget

        weights = parse_weights(self.weight)
        held = find_held(self.hold, self.hand)
        with console.progress(f"{self.clip} on {self.body}") as report:
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
                weights=weights,
                hold=held,
                seed=self.seed,
                threads=self.threads,
                out=self.out,
                resume=self.resume,
                overwrite=self.overwrite,
                progress=report,
            )
        console.show_runs([run])


@dataclass(frozen=True)
class Export:
    """Write runs as files that other programs open (docs/export.md).

    Args:
        runs: folders of runs; several share one file in glb, usd and mp4
        out: the file; for several runs in other formats, a folder
        format: what to write: glb, bvh, usd, amass, mjcf, mp4 or csv
        source: the source motion too, as a ghost (glb, usd, mp4) or more columns (csv), or in
            place of the simulated one (bvh, amass, mjcf)
        capsules: the simulator's shapes in place of the skin (glb, usd, mp4)
        rate: pictures (mp4) or keyframes (mjcf) a second
        size: width and height of the video, pixels
    """

    runs: Runs
    out: Annotated[Path, arg(metavar="FILE")]
    format: Annotated[
        Literal["glb", "bvh", "usd", "amass", "mjcf", "mp4", "csv"] | None,
        left_out("FORMAT", "as the suffix of --out says"),
    ] = None
    source: Flag = False
    capsules: Flag = False
    rate: Annotated[float | None, left_out("NUMBER", "25")] = None
    size: Annotated[
        tuple[int, int] | None, left_out("WIDTH HEIGHT", "640 480, 960 480 for three figures or more")
    ] = None

    def run(self) -> None:
        """Write them and say where they are."""
        from physique.commands.export import export_run

        files = export_run(
            self.runs,
            self.format,
            self.out,
            source=self.source,
            capsules=self.capsules,
            rate=self.rate,
            size=self.size,
        )
        console.show_files(files)


@dataclass(frozen=True)
class Report:
    """Write runs as one HTML page to look at and to mail; it needs no network (docs/report.md).

    Args:
        runs: folders of runs; several stand side by side and are compared
        out: the page
    """

    runs: Runs
    out: Annotated[Path, arg(metavar="FILE.html")]

    def run(self) -> None:
        """Write it and say where it is."""
        from physique.report.report import write_report

        console.show_files([write_report(self.out, self.runs)])


@dataclass(frozen=True)
class Demo:
    """Retarget an embedded clip onto two ready bodies, with pictures.

    Args:
        out: the folder for the results; a demo that is there is replaced
        threads: that simulate; they do not change the result
    """

    out: Annotated[Path, arg(metavar="DIR")] = Path("out/demo")
    threads: Threads = None

    def run(self) -> None:
        """Run and show it."""
        from physique.commands.demo import run_demo

        with console.progress("demo") as report:
            result = run_demo(self.out, threads=self.threads, progress=report)
        console.show_runs(result.runs)
        console.show_files(result.pictures)


@dataclass(frozen=True)
class View:
    """Serve a page that plays runs, and lets people push the bodies (docs/view.md).

    Args:
        runs: folders of runs, at most six, side by side
        port: to serve on; 0 takes a free one
        host: to serve on; anything but 127.0.0.1 opens the page to others
    """

    runs: Runs
    port: Annotated[int, arg(metavar="PORT")] = 8080
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"

    def run(self) -> None:
        """Serve until Ctrl-C."""
        from physique.live.serve import view

        with contextlib.suppress(KeyboardInterrupt):
            view(self.runs, host=self.host, port=self.port, told=console.say)


@dataclass(frozen=True)
class Stabilize:
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
class Grow:
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
    interval: Annotated[float, arg(metavar="SECONDS")] = 0.1
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
        with console.growth(str(self.run_folder)) as report:
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
class Push:
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
    duration: Annotated[float, arg(metavar="SECONDS")] = 0.1
    trials: Annotated[int, arg(metavar="COUNT")] = 100
    seed: int = 0
    controller: Annotated[
        Literal["pd", "lqr", "tree"] | None, left_out("pd|lqr|tree", "the tree where there is one, else lqr")
    ] = None
    from_: Annotated[
        float | None, arg(metavar="SECONDS", name="from", help_behavior_hint="(default: the beginning)")
    ] = None
    to: Annotated[float | None, left_out("SECONDS", "1.5 s before the end")] = None
    json: Flag = False

    def run(self) -> None:
        """Push it and show how it stood that."""
        from physique.commands.push import push

        with console.counting(f"pushing {self.run_folder}", self.trials) as on_trial:
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


Command = Bodies | Clips | Body | Retarget | Export | Report | View | Stabilize | Grow | Push | Demo


def parse(arguments: list[str] | None = None) -> Command:
    """The subcommand that the arguments ask for. Raises InputError for a fault in them."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                Command,
                prog="physique",
                description="Make a body shape perform a motion-capture clip under physics.",
                args=arguments,
                config=(FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        raise console.usage_error(said.getvalue()) from None


def main(arguments: list[str] | None = None) -> None:
    """Run the command line: exit code 0, 2 for bad input, 130 after Ctrl-C."""
    console.set_up_logging()
    try:
        parse(arguments).run()
        sys.stdout.flush()
    except InputError as fault:
        console.fail(str(fault))
        sys.exit(2)
    except KeyboardInterrupt:
        console.fail("stopped; `retarget` and `grow` go on with the same options and --resume")
        sys.exit(130)
    except BrokenPipeError:
        # The reader of a pipe (head, less) has seen enough.
        console.abandon_stdout()

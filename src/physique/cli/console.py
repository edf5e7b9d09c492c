"""What the commands show: tables on stdout; progress, warnings and errors on stderr."""

from __future__ import annotations

import dataclasses
import json
import logging
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from physique.errors import InputError

if TYPE_CHECKING:
    from physique.body.describe import BodyFacts
    from physique.commands.push import PushReport
    from physique.commands.retarget import Progress as Step
    from physique.feedback.growth import GrowthProgress
    from physique.feedback.pushes import Trial
    from physique.runs.run import Run


_FILE_WIDTH = 200  # characters, of tables that go to a file or a pipe


def fail(text: str) -> None:
    """Print an error, one line, to stderr."""
    sys.stderr.write(f"physique: {text}\n")


def say(text: str) -> None:
    """Print a line to stdout, at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def usage_error(text: str) -> InputError:
    """What the argument parser says in a box of many lines, as one."""
    lines = [line for line in text.splitlines() if not line.startswith("╭")]  # but the box's title
    words = " ".join(re.sub(r"[─│╰╯]+", " ", " ".join(lines)).split())
    for rest in ("Got errors:", "Argument helptext:", "For full helptext"):
        words = words.split(rest)[0]
    # What stands for an option that is left out cannot be given.
    words = words.replace("'None', ", "").replace(", 'None')", ")")
    return InputError(
        "command line",
        words.strip(" .") or "a fault",
        "options as in the help",
        "see `physique --help` or `physique COMMAND --help`",
    )


def set_up_logging() -> None:
    """Show the library's warnings on stderr, one line each."""
    handler = RichHandler(
        console=Console(stderr=True, soft_wrap=True),
        show_time=False,
        show_path=False,
        markup=False,
        highlighter=None,
    )
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])


def abandon_stdout() -> None:
    """Let the interpreter's last flush go nowhere: nobody reads stdout any more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table to stdout."""
    out = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, column in enumerate(columns):
        numbers = bool(rows) and all(_is_number(row[index]) for row in rows)
        out.add_column(column, justify="right" if numbers else "left", no_wrap=index == 0)
    for row in rows:
        out.add_row(*row)
    screen = Console(soft_wrap=False)
    if not screen.is_terminal:
        screen.width = _FILE_WIDTH
    screen.print(out, markup=False)


def show_facts(facts: BodyFacts, as_json: bool) -> None:
    """Print what a body is like, as a table or as JSON."""
    if as_json:
        sys.stdout.write(json.dumps(dataclasses.asdict(facts), indent=2) + "\n")
        return
    rows = [
        ("height", f"{facts.height_m:.3f} m"),
        ("mass", f"{facts.mass_kg:.1f} kg"),
        ("volume", f"{1e3 * facts.volume_m3:.1f} l"),
        ("capsule error, mean", f"{facts.capsule_error_cm:.2f} cm"),
        ("capsule error, largest", f"{facts.capsule_error_max_cm:.1f} cm"),
        ("fit", f"{facts.fit_seconds:.1f} s"),
        *((f"mass of {part}", f"{kg:.2f} kg") for part, kg in facts.segment_mass.items()),
    ]
    table(("", ""), rows)


def show_runs(runs: Sequence[Run]) -> None:
    """Print the main metrics of runs, a column each."""
    rows: list[tuple[str, Callable[[Run], str]]] = [
        ("followed to the end", lambda r: "yes" if r.success else "no"),
        ("seconds of motion", lambda r: f"{r.metrics['seconds']:.2f}"),
        ("joint error, mean mm", lambda r: f"{r.metrics['mpjpe_mm']:.1f}"),
        ("joint error, worst frame mm", lambda r: f"{r.metrics['mpjpe_max_mm']:.1f}"),
        ("joint error, root-aligned mm", lambda r: f"{r.metrics['mpjpe_local_mm']:.1f}"),
        ("foot skate mm/s", lambda r: f"{r.metrics['foot_skate_mm_per_s']:.1f}"),
        ("floor penetration, mean mm", lambda r: f"{r.metrics['penetration_mm']:.1f}"),
        ("torques at their limit", lambda r: f"{r.metrics['torque_saturation']:.1%}"),
        ("cost E", lambda r: f"{r.metrics['cost']['total']:.2f}"),
        ("simulated steps", lambda r: f"{r.metrics['sim_steps']:,}"),
        ("wall seconds", lambda r: f"{r.metrics['wall_s']:.1f}"),
    ]
    table(("", *(r.name for r in runs)), [(label, *(show(r) for r in runs)) for label, show in rows])
    show_files([r.folder for r in runs if r.folder is not None])


def show_files(paths: Sequence[Path]) -> None:
    """Print where results are."""
    for path in paths:
        sys.stdout.write(f"{path}\n")


def show_tree(tree: dict[str, Any]) -> None:
    """Print the subtrees of a tree, from the motion's end on, and what growing took."""
    names = ("timestep", "trials", "covered", "perturbed_states", "nodes", "failed")
    rows = [tuple(str(subtree[name]) for name in names) for subtree in tree["subtrees"]]
    rows.append(("all", *(str(tree[name]) for name in names[1:])))
    table(tuple(name.replace("_", " ") for name in names), rows)
    sys.stdout.write(f"{tree['sim_steps']:,} simulated steps, {tree['seconds']:.0f} s\n")


def show_pushes(report: PushReport, as_json: bool) -> None:
    """Print how a controller stood pushes, as a table or as JSON."""
    if as_json:
        sys.stdout.write(json.dumps(dataclasses.asdict(report), indent=2) + "\n")
        return
    recovery, decision = report.median_recovery_s, report.decision_ms
    rows = [
        ("impulse", f"{report.impulse_ns:g} Ns, {report.delta_v:.2f} m/s"),
        ("survived", f"{report.survived} of {report.trials} ({report.survival:.0%})"),
        ("recovery, median", "none" if recovery is None else f"{recovery:.2f} s"),
        (
            "online decision, median and worst",
            f"{decision['median']:.0f} and {decision['worst']:.0f} ms" if decision else "none",
        ),
        ("seconds of motion a second", f"{report.realtime_factor:.1f}"),
    ]
    table(("", ""), rows)


def _tenths(screen: Console) -> Callable[[str, str, float], None]:
    """A function of a work's title, its state and the share that is done, 0 to 1: it tells them on
    stderr, a line for each tenth, where no terminal shows the bar."""
    told: set[tuple[str, int]] = set()

    def tell(title: str, state: str, share: float) -> None:
        tenth = (title, int(10 * share + 1e-9))
        if not screen.is_terminal and tenth not in told:
            told.add(tenth)
            sys.stderr.write(f"{title}: {state}\n")

    return tell


def _bar(screen: Console, state: TextColumn) -> Progress:
    """A bar with a title, a state in words and the time; none where no terminal is."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        state,
        TimeElapsedColumn(),
        console=screen,
        transient=True,
        redirect_stdout=False,
        disable=not screen.is_terminal,
    )


@contextmanager
def counting(title: str, total: int) -> Iterator[Callable[[int, Trial], None]]:
    """A progress bar on stderr of trials, and how many were survived; none where no terminal is."""
    screen = Console(stderr=True)
    bar = _bar(screen, TextColumn("{task.completed} of {task.total}, {task.fields[survived]} survived"))
    survived = 0
    with bar:
        task = bar.add_task(title, total=total, survived=0)

        def report(done: int, trial: Trial) -> None:
            nonlocal survived
            survived += trial.survived
            bar.update(task, completed=done, survived=survived)

        yield report


@contextmanager
def growth(title: str) -> Iterator[Callable[[GrowthProgress], None]]:
    """A progress bar on stderr of a growing tree; where that is no terminal, a line a tenth."""
    screen = Console(stderr=True)
    bar = _bar(screen, TextColumn("{task.fields[state]}", markup=False))
    with bar:
        task = bar.add_task(title, total=None, state="starting")
        tell = _tenths(screen)

        def report(step: GrowthProgress) -> None:
            state = (
                f"{step.coverage:.0%} covered, {step.states} perturbed states, {step.nodes} nodes, "
                f"{step.seconds_left:.0f} s left"
            )
            bar.update(task, total=step.total, completed=step.done, state=state)
            tell(title, state, step.done / step.total)

        yield report


@contextmanager
def progress(title: str) -> Iterator[Callable[[Step], None]]:
    """A progress bar on stderr; where that is no terminal, a line a tenth."""
    screen = Console(stderr=True)
    bar = _bar(screen, TextColumn("{task.fields[state]}", markup=False))
    with bar:
        task = bar.add_task(title, total=None, state="reading")
        tell = _tenths(screen)

        def report(step: Step) -> None:
            state = f"{step.done:.1f} of {step.total:.1f} s"
            if step.error is not None:
                state += f", error {1e3 * step.error:.0f} mm"
            if step.cost is not None:
                state += f", E {step.cost:.2f}"
            if step.iteration:
                state += f" ({step.iteration})"
            bar.update(task, description=step.name, total=step.total, completed=step.done, state=state)
            tell(step.name, state, step.done / step.total)

        yield report


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "").rstrip("%"))
    except ValueError:
        return False
    return True

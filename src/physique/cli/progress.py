"""How far long work is: a bar on stderr; where that is no terminal, a line for each tenth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from physique.cli.console import Screen, tell

if TYPE_CHECKING:
    from physique.commands.retarget import Progress as Step
    from physique.feedback.growth import GrowthProgress
    from physique.feedback.pushes import Trial

#: Shows a title, a state in words and how much is done of how much.
Show = Callable[[str, str, float, float], None]


@contextmanager
def _bar(title: str) -> Iterator[Show]:
    """A bar with a title, a state and the time; it says too when loops are compiled."""
    screen = Screen(stderr=True)
    told: set[tuple[str, int]] = set()
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[state]}", markup=False),
        TimeElapsedColumn(),
        console=screen,
        transient=True,
        redirect_stdout=False,
        disable=not screen.is_terminal,
    )
    with bar:
        task = bar.add_task(title, total=None, state="starting")

        def show(title: str, state: str, done: float, total: float) -> None:
            bar.update(task, description=title, total=total, completed=done, state=state)
            tenth = (title, int(10 * done / total + 1e-9))
            if not screen.is_terminal and tenth not in told:
                told.add(tenth)
                tell(f"{title}: {state}\n")

        def show_compiling(begun: int, total: int) -> None:
            state = f"compiling, once on this machine: {begun} of {total}"
            bar.update(task, total=total, completed=begun, state=state)
            if not screen.is_terminal and ("compiling", 0) not in told:
                told.add(("compiling", 0))
                tell(f"{title}: compiling, once on this machine (about half a minute)\n")

        from physique.compiled import compiling  # numba takes a second: the bar is there already

        with compiling(show_compiling):
            yield show


@contextmanager
def counting(title: str, total: int) -> Iterator[Callable[[int, Trial], None]]:
    """The progress of trials, and how many were survived."""
    survived = 0
    with _bar(title) as show:

        def report(done: int, trial: Trial) -> None:
            nonlocal survived
            survived += trial.survived
            show(title, f"{done} of {total}, {survived} survived", done, total)

        yield report


@contextmanager
def growth(title: str) -> Iterator[Callable[[GrowthProgress], None]]:
    """The progress of a growing tree."""
    with _bar(title) as show:

        def report(step: GrowthProgress) -> None:
            state = (
                f"{step.coverage:.0%} covered, {step.states} perturbed states, {step.nodes} nodes, "
                f"{step.seconds_left:.0f} s left"
            )
            show(title, state, step.done, step.total)

        yield report


@contextmanager
def tracking(title: str) -> Iterator[Callable[[Step], None]]:
    """The progress of a run."""
    with _bar(title) as show:

        def report(step: Step) -> None:
            state = f"{step.done:.1f} of {step.total:.1f} s"
            if step.error is not None:
                state += f", error {1e3 * step.error:.0f} mm"
            if step.cost is not None:
                state += f", E {step.cost:.2f}"
            if step.iteration:
                state += f" ({step.iteration})"
            show(step.name, state, step.done, step.total)

        yield report

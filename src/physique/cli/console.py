"""What the commands show: tables on stdout; warnings and errors on stderr.

A reader that has seen enough (`| head -1`) ends what is shown, never the work.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import os
import platform
import re
import shlex
import sys
import tempfile
import textwrap
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TextIO

from rich import box
from rich.console import Console
from rich.logging import RichHandler
from rich.table import Table

from physique.errors import InputError, reason

if TYPE_CHECKING:
    from physique.body.describe import BodyFacts
    from physique.commands.push import PushReport
    from physique.runs.run import Run


_FILE_WIDTH = 200  # characters, of tables that go to a file or a pipe


class Screen(Console):
    """A console that says no more once nobody reads it."""

    def on_broken_pipe(self) -> None:
        """Go on in silence; rich would end the process."""
        self.quiet = True
        _abandon(self.file)


def say(text: str) -> None:
    """Print a line to stdout, at once."""
    _write(sys.stdout, f"{text}\n")


def tell(text: str) -> None:
    """Print text as it is to stderr, at once."""
    _write(sys.stderr, text)


def fail(text: str) -> None:
    """Print an error, one line, to stderr."""
    tell(f"physique: {text}\n")


def fail_unforeseen(fault: Exception, arguments: Sequence[str], versions: str) -> None:
    """Print an error that no message was written for, and where its traceback is kept."""
    about = f"{versions}, Python {platform.python_version()}, {platform.platform()}"
    report = f"{about}\nphysique {shlex.join(arguments)}\n\n{''.join(traceback.format_exception(fault))}"
    words = textwrap.shorten(f"{type(fault).__name__}: {fault}", 200)
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="physique-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            file.write(report)
        where = f"please report it, with the file {file.name}"
    except OSError:
        where = f"no file could be written, so please report this:\n{report}"
    fail(f"a fault of physique's own: {words}; {where}")


def usage_error(text: str, place: str) -> InputError:
    """What the argument parser says in a box of many lines, as one; its help has `place`."""
    # But the box's title, and what options are for, which is set far in.
    lines = [line for line in text.splitlines() if not line.startswith(("╭", "│         "))]
    words = " ".join(re.sub(r"[─│╰╯]+", " ", " ".join(lines)).split())
    for rest in ("Got errors:", "Argument helptext:", "For full helptext"):
        words = words.split(rest)[0]
    # What stands for an option that is left out cannot be given.
    words = words.replace("'None', ", "").replace(", 'None')", ")").strip(" .")
    words = re.sub(r"^Error parsing (\S+): .*?('[^']*')\]?$", r"\2 for \1", words)
    return InputError(
        "command line",
        f"{words[:1].lower()}{words[1:]}" or "a fault",
        "options as in the help",
        f"see `{place} --help`",
    )


def set_up_logging() -> None:
    """Show the library's warnings on stderr, one line each."""
    handler = RichHandler(
        console=Screen(stderr=True, soft_wrap=True),
        show_time=False,
        show_path=False,
        markup=False,
        highlighter=None,
    )
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])


def _write(stream: TextIO | None, text: str) -> None:
    """Write to stdout or stderr, which may be closed, now or from the first."""
    if stream is None or not text:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError as fault:
        _give_up(stream, fault)


def _give_up(stream: TextIO, fault: OSError) -> None:
    """Say no more there. Who left does not miss it; what a full disk loses of results is said."""
    _abandon(stream)
    if stream is sys.stdout and not isinstance(fault, BrokenPipeError):
        raise InputError(
            "standard output", reason(fault), "a place that takes it", "free some space"
        ) from None


def _abandon(stream: IO[str]) -> None:
    """Let all further output, the interpreter's last flush too, go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table to stdout."""
    out = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, column in enumerate(columns):
        numbers = bool(rows) and all(_is_number(row[index]) for row in rows)
        out.add_column(column, justify="right" if numbers else "left", no_wrap=index == 0)
    for row in rows:
        out.add_row(*row)
    screen = Screen(soft_wrap=False)
    if not screen.is_terminal:
        screen.width = _FILE_WIDTH
    try:
        screen.print(out, markup=False)
    except OSError as fault:
        _give_up(sys.stdout, fault)


def show_facts(facts: BodyFacts, as_json: bool) -> None:
    """Print what a body is like, as a table or as JSON."""
    if as_json:
        say(json.dumps(dataclasses.asdict(facts), indent=2))
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
        say(str(path))


def show_tree(tree: dict[str, Any]) -> None:
    """Print the subtrees of a tree, from the motion's end on, and what growing took."""
    names = ("timestep", "trials", "covered", "perturbed_states", "nodes", "failed")
    rows = [tuple(str(subtree[name]) for name in names) for subtree in tree["subtrees"]]
    rows.append(("all", *(str(tree[name]) for name in names[1:])))
    table(tuple(name.replace("_", " ") for name in names), rows)
    say(f"{tree['sim_steps']:,} simulated steps, {tree['seconds']:.0f} s")


def show_pushes(report: PushReport, as_json: bool) -> None:
    """Print how a controller stood pushes, as a table or as JSON."""
    if as_json:
        say(json.dumps(dataclasses.asdict(report), indent=2))
        return
    recovery, decision = report.median_recovery_s, report.decision_ms
    rows = [
        ("controller", report.controller),
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


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "").rstrip("%"))
    except ValueError:
        return False
    return True

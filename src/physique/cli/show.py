"""The commands that show runs to people and other programs."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from physique.cli import console
from physique.cli.options import Flag, Runs, left_out
from physique.export.formats import names


@dataclass(frozen=True)
class ExportCommand:
    """Write runs as files that other programs open (docs/export.md).

    Args:
        runs: folders of runs
        source: the source motion too, as a ghost or as more columns; in place of the simulated one
            where a file holds one motion
    """

    runs: Runs
    out: Annotated[
        Path, arg(metavar="FILE", help=f"the file; a folder for several runs, but for {names(together=True)}")
    ]
    format: Annotated[
        str | None, left_out("FORMAT", "as the suffix of --out says"), arg(help=f"what to write: {names()}")
    ] = None
    source: Flag = False
    capsules: Annotated[
        Flag, arg(help=f"the simulator's shapes in place of the skin ({names('capsules')})")
    ] = False
    rate: Annotated[
        float | None, left_out("NUMBER", "25"), arg(help=f"pictures or keyframes a second ({names('rate')})")
    ] = None
    size: Annotated[
        tuple[int, int] | None,
        left_out("WIDTH HEIGHT", "640 480, 960 480 for three figures or more"),
        arg(help=f"width and height of pictures, pixels ({names('size')})"),
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
class ReportCommand:
    """Write runs as one HTML page to look at and to mail; it needs no network (docs/report.md).

    Args:
        runs: folders of runs; several stand side by side and are compared
        out: the page
    """

    runs: Runs
    out: Annotated[Path, arg(metavar="FILE.html")]

    def run(self) -> None:
        """Write it and say where it is."""
        from physique.commands.report import write_report

        console.show_files([write_report(self.out, self.runs)])


@dataclass(frozen=True)
class ViewCommand:
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

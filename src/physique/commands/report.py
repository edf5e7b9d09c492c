"""Runs as one HTML file to look at and to mail."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from physique.commands.outputs import check_output
from physique.report.report import report_html
from physique.runs.run import Run, load_run
from physique.store import PathLike, prepare_folder, write_atomic

log = logging.getLogger(__name__)

#: What mail systems take without complaint, for each run.
MOST_BYTES = 3_000_000


def write_report(path: PathLike, runs: Sequence[Run | PathLike]) -> Path:
    """Write a report of one or several runs, or of their folders, as one HTML file; its path.

    The file loads nothing: models, data and scripts are in it, and a content security policy
    forbids the rest. Raises InputError for a folder without a finished run, for a run that ended
    before its first step, for a path that does not end in .html, and where the file cannot be
    written.
    """
    path = Path(path)
    check_output(path, (".html", ".htm"))
    loaded = [run if isinstance(run, Run) else load_run(run) for run in runs]
    page = report_html(loaded).encode()
    if len(page) > MOST_BYTES * len(loaded):
        log.warning(
            "%s has %.1f MB, more than %.0f a run: a skin of many vertices",
            path,
            len(page) / 1e6,
            MOST_BYTES / 1e6,
        )
    prepare_folder(path.parent)
    write_atomic(path, page)
    return path

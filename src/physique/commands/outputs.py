"""Where commands may write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from physique.errors import InputError
from physique.runs.run import protect_runs


def check_output(path: Path, suffixes: Sequence[str]) -> None:
    """Raise InputError for a path that ends in none of `suffixes`, a folder, and a file of a run."""
    protect_runs(path)
    if path.suffix.lower() in suffixes and not path.is_dir():
        return
    found = "a folder" if path.is_dir() else f"suffix {path.suffix!r}"
    raise InputError(str(path), found, f"a file that ends in {' or '.join(suffixes)}", "correct the path")

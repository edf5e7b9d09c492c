"""Runs as files that other programs open."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from physique.commands.outputs import check_output
from physique.errors import InputError
from physique.export.formats import find_format
from physique.runs.run import Run, load_run
from physique.store import PathLike, prepare_folder


def export_run(
    runs: Run | PathLike | Sequence[Run | PathLike],
    format: str | None,  # noqa: A002
    out: PathLike,
    *,
    source: bool = False,
    capsules: bool = False,
    rate: float | None = None,
    size: tuple[int, int] | None = None,
) -> list[Path]:
    """Write runs in a format that other programs open; the files that were written come back.

    runs: one or several, or their folders. format: a name of `export.formats.FORMATS`; None takes
        what the suffix of `out` says.
    out: a file. Several runs share it in glb, usd and mp4; for the other formats it is then a
        folder, where each run has a file named after its clip and body.
    source: the source motion, where it was recorded, on this body, too: as a ghost beside (mp4), a
        pale figure in its true place (glb, usd) or more columns (csv); bvh, amass and mjcf hold one
        motion, and it is the source then.
    capsules: the simulator's shapes in place of the skin (glb, usd, mp4).
    rate: pictures (mp4) or keyframes (mjcf) a second; 25 if left out.
    size: width and height of pictures (mp4), pixels.

    Each file is written whole or not at all. Raises InputError for a format that is not known, a
    suffix that does not fit it, an option that it does not have, a run that is none, a missing
    extra (usd, video), or where a file cannot be written.
    """
    out = Path(out)
    kind = find_format(format, out)
    every = {"source": source, "capsules": capsules, "rate": rate, "size": size}
    options = {name: value for name, value in every.items() if value is not None and value is not False}
    kind.check(options)
    several = list(runs) if isinstance(runs, Sequence) and not isinstance(runs, str) else [runs]
    if not several:
        raise InputError("runs", "none", "at least one run", "name the folder of a run")
    loaded = [run if isinstance(run, Run) else load_run(run) for run in several]
    if kind.together or len(loaded) == 1:
        check_output(out, kind.suffixes)
        prepare_folder(out.parent)
        return [kind.write(out, loaded, options)]
    if kind.owns(out) or out.is_file():
        raise InputError(
            str(out),
            f"one file for {len(loaded)} runs",
            f"a folder, since a {kind.name} file holds one motion",
            "give a folder as --out, or export one run",
        )
    prepare_folder(out)
    names = file_names([run.name for run in loaded])
    return [kind.write(out / f"{name}{kind.suffixes[0]}", [run], options) for name, run in zip(names, loaded)]


def file_names(titles: Sequence[str]) -> list[str]:
    """Names of files, without suffixes, for these titles: all different, and nothing in them that
    could lead to another folder or that a system forbids."""
    names: list[str] = []
    for title in titles:
        name = re.sub(r"[^A-Za-z0-9_-]+", "_", title).strip("_-")[:80] or "run"
        taken = {other.lower() for other in names}
        count, unique = 1, name
        while unique.lower() in taken:
            count += 1
            unique = f"{name}_{count}"
        names.append(unique)
    return names

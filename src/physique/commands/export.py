"""Runs as files that other programs open."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Literal

from physique.errors import InputError
from physique.export.amass import write_amass
from physique.export.bvh import write_body_bvh
from physique.export.mjcf import write_mjcf
from physique.export.table import write_table
from physique.runs.run import Run, load_run
from physique.store import PathLike, prepare_folder

Format = Literal["glb", "bvh", "usd", "amass", "mjcf", "mp4", "csv"]

#: How the files of each format end; the first one is the format's own.
SUFFIXES: dict[Format, tuple[str, ...]] = {
    "glb": (".glb",),
    "bvh": (".bvh",),
    "usd": (".usd", ".usdc", ".usda"),
    "amass": (".npz",),
    "mjcf": (".xml", ".mjcf"),
    "mp4": (".mp4",),
    "csv": (".csv",),
}
#: Formats that show several runs in one file; the others hold one motion each.
TOGETHER: tuple[Format, ...] = ("glb", "usd", "mp4")


def export_run(
    runs: Run | PathLike | Sequence[Run | PathLike],
    format: Format | None,  # noqa: A002
    out: PathLike,
    *,
    source: bool = False,
    capsules: bool = False,
    rate: float | None = None,
    size: tuple[int, int] | None = None,
) -> list[Path]:
    """Write runs in a format that other programs open; the files that were written come back.

    runs: one or several, or their folders. format: None takes what the suffix of `out` says.
    out: a file. Several runs share it in glb, usd and mp4; for the other formats it is then a
        folder, where each run has a file named after its clip and body.
    source: the source motion, as retargeted to the body, too: as a ghost beside (mp4), a pale
        figure in its true place (glb, usd) or more columns (csv); bvh, amass and mjcf hold one
        motion, and it is the source then.
    capsules: the simulator's shapes in place of the skin (glb, usd, mp4).
    rate: pictures (mp4) or keyframes (mjcf) a second; 25 if left out.
    size: width and height of pictures (mp4), pixels.

    Each file is written whole or not at all. Raises InputError for a format that is not known, a
    suffix that does not fit it, an option that it does not have, a run that is none, a missing
    extra (usd, video), or where a file cannot be written.
    """
    out = Path(out)
    kind = _format(format, out)
    _check_option(kind, "capsules", capsules, ("glb", "usd", "mp4"))
    _check_option(kind, "rate", rate, ("mjcf", "mp4"))
    _check_option(kind, "size", size, ("mp4",))
    write = partial(_write, kind, source=source, capsules=capsules, rate=rate, size=size)
    several = list(runs) if isinstance(runs, Sequence) and not isinstance(runs, str) else [runs]
    if not several:
        raise InputError("runs", "none", "at least one run", "name the folder of a run")
    loaded = [run if isinstance(run, Run) else load_run(run) for run in several]
    if kind in TOGETHER or len(loaded) == 1:
        _check_suffix(kind, out)
        prepare_folder(out.parent)
        return [write(out, loaded)]
    if out.suffix.lower() in SUFFIXES[kind] or out.is_file():
        raise InputError(
            str(out),
            f"one file for {len(loaded)} runs",
            f"a folder, since a {kind} file holds one motion",
            "give a folder as --out, or export one run",
        )
    prepare_folder(out)
    names = file_names([run.name for run in loaded])
    suffix = SUFFIXES[kind][0]
    return [write(out / f"{name}{suffix}", [run]) for name, run in zip(names, loaded)]


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


def _write(
    kind: Format,
    path: Path,
    runs: Sequence[Run],
    *,
    source: bool,
    capsules: bool,
    rate: float | None,
    size: tuple[int, int] | None,
) -> Path:
    # Packages of extras, MuJoCo and compiled loops come with their own formats only.
    match kind:
        case "glb":
            from physique.export.gltf import write_glb

            return write_glb(path, runs, source=source, capsules=capsules)
        case "usd":
            from physique.export.usd import write_usd

            return write_usd(path, runs, source=source, capsules=capsules)
        case "mp4":
            from physique.export.video import write_video

            return write_video(path, runs, source=source, capsules=capsules, rate=rate, size=size)
        case "bvh":
            motion = runs[0].trajectory
            q = motion.reference_q if source else motion.q
            return write_body_bvh(path, runs[0].body.joints, q, 1.0 / runs[0].timestep)
        case "amass":
            return write_amass(path, runs[0], source=source)
        case "mjcf":
            return write_mjcf(path, runs[0], source=source, rate=rate)
        case "csv":
            return write_table(path, runs[0], source=source)


def _format(wanted: Format | None, out: Path) -> Format:
    for kind, suffixes in SUFFIXES.items():
        if wanted == kind or (wanted is None and out.suffix.lower() in suffixes):
            return kind
    found = repr(wanted) if wanted is not None else f"the suffix {out.suffix!r} of {out.name!r}"
    remedy = "give one of these as --format"
    if out.suffix.lower() == ".fbx":
        remedy = "write a .glb, then `python tools/glb_to_fbx.py in.glb out.fbx` (needs the package bpy)"
    raise InputError("format", found, ", ".join(SUFFIXES), remedy)


def _check_suffix(kind: Format, out: Path) -> None:
    if out.suffix.lower() in SUFFIXES[kind] and not out.is_dir():
        return
    found = "a folder" if out.is_dir() else f"suffix {out.suffix!r}"
    wanted = " or ".join(SUFFIXES[kind])
    raise InputError(str(out), found, f"a file that ends in {wanted}", "correct the path")


def _check_option(kind: Format, name: str, value: object, kinds: Sequence[Format]) -> None:
    if value is not None and value is not False and kind not in kinds:
        raise InputError(f"option {name}", f"the format {kind}", " or ".join(kinds), f"leave {name} out")

"""The folder of a run that is written: its lock, what it holds already, checkpoints, the end.

`run.json` comes first and says what the run is; each finished window is one file; at the end the
results are written, then `run.json` again with status "finished", and the checkpoints go. Whatever
moment a process is killed at, the folder is either a run to resume or a finished one. Nothing in
it is replaced without `overwrite`, and then it is named first.
"""

from __future__ import annotations

import json
import logging
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from physique.errors import InputError
from physique.provenance import fingerprint, require_same
from physique.runs.lock import locked
from physique.runs.run import FORMAT, NAMES, RECORD, TREE, WINDOWS, Run, finish_run, load_run, read_record
from physique.store import PathLike, prepare_folder, read_json, read_npz, write_json, write_npz
from physique.tracking.windows import Window

log = logging.getLogger(__name__)

_ARRAYS = ("q", "v", "control", "torque", "shift", "tail_q", "tail_v", "tail_control")
_NUMBERS = ("start", "stop", "cost", "iterations", "sim_steps", "status", "terms")


@dataclass(frozen=True)
class Checkpoint:
    """A finished window and the seconds of wall time that it took."""

    window: Window
    wall_s: float


@dataclass(frozen=True)
class RunFolder:
    """A run in the making. checkpoints: its windows so far. finished: the run, where it is."""

    path: Path
    identity: Mapping[str, Any]
    checkpoints: tuple[Checkpoint, ...] = ()
    finished: Run | None = None

    def save(self, index: int, checkpoint: Checkpoint) -> None:
        """Store window number `index`."""
        window = checkpoint.window
        facts = {name: getattr(window, name) for name in _NUMBERS}
        facts |= {"wall_s": checkpoint.wall_s, "run": fingerprint(self.identity)}
        arrays = {name: getattr(window, name) for name in _ARRAYS}
        write_npz(_window_path(self.path, index), {**arrays, "facts": np.array(json.dumps(facts))})

    def finish(self, run: Run) -> Run:
        """Write the results of `run` (but the BVH file, see the command); checkpoints go."""
        stored = finish_run(self.path, run)
        shutil.rmtree(self.path / WINDOWS, ignore_errors=True)
        return stored


@contextmanager
def open_run(
    folder: PathLike, record: Mapping[str, Any], *, resume: bool, overwrite: bool
) -> Iterator[RunFolder]:
    """Start a run in `folder`, or go on with the one in it, alone until the end of the block.

    record: what the run is; a run in the folder that is to be resumed must agree in its identity.
    A damaged checkpoint is reported, and the run goes on before it. Raises InputError for a folder
    that cannot be written, that another process works in, that holds a run and neither `resume`
    nor `overwrite` is set, or that holds another run than the one to resume.
    """
    check_choice(resume, overwrite)
    folder = prepare_folder(folder)
    with locked(folder):
        held = [name for name in NAMES if (folder / name).exists()]
        if held and not (overwrite or (resume and RECORD in held)):
            raise InputError(
                str(folder),
                "a finished run" if _finished(folder) else "files of a run",
                "a new or empty folder",
                "choose another --out, add --resume to go on with it or --overwrite to replace it",
            )
        yield _resume(folder, record) if held and resume else _start(folder, record, held)


@contextmanager
def change_run(folder: PathLike) -> Iterator[Run]:
    """The finished run in a folder, for what is added to it, alone until the end of the block.

    Raises InputError as `load_run`, and where another process works in the folder.
    """
    read_record(Path(folder))
    with locked(Path(folder)):
        yield load_run(folder)


def check_choice(resume: bool, overwrite: bool) -> None:
    """Raise InputError where both are asked for."""
    if resume and overwrite:
        raise InputError(
            "--resume and --overwrite", "both", "at most one", "go on with what is there, or replace it"
        )


def warn_replaced(folder: Path, names: Sequence[str]) -> None:
    """Name what is about to be overwritten."""
    if names:
        log.warning("%s: replaces %s", folder, ", ".join(describe(folder, name) for name in names))


def describe(folder: Path, name: str) -> str:
    """The name of a file in a run's folder, with what a tree has cost."""
    if name == TREE:
        try:
            tree = read_json(folder / name)
            return f"{name} ({tree['perturbed_states']} states, {tree['seconds']:.0f} s of growth)"
        except (InputError, KeyError, TypeError, ValueError):
            pass
    return name


def _start(folder: Path, record: Mapping[str, Any], held: Sequence[str]) -> RunFolder:
    warn_replaced(folder, held)
    # First the record: whatever is there beside it from then on is this run's, or left over.
    write_json(folder / RECORD, {**record, "format": FORMAT, "status": "running"})
    _remove(folder, [name for name in held if name != RECORD])
    prepare_folder(folder / WINDOWS)
    return RunFolder(folder, record["identity"])


def _remove(folder: Path, names: Sequence[str]) -> None:
    for name in names:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def _resume(folder: Path, record: Mapping[str, Any]) -> RunFolder:
    stored, identity = read_record(folder), record["identity"]
    remedy = "resume with the same options and inputs, choose another --out or add --overwrite"
    require_same(folder / RECORD, "a run", stored["identity"], identity, remedy)
    if stored.get("status") == "finished":
        shutil.rmtree(folder / WINDOWS, ignore_errors=True)
        return RunFolder(folder, identity, finished=load_run(folder))
    # What an `overwrite` that was killed had not removed yet.
    _remove(folder, [name for name in NAMES if name not in (RECORD, WINDOWS)])
    prepare_folder(folder / WINDOWS)
    return RunFolder(folder, identity, tuple(_read_windows(folder, fingerprint(identity))))


def _finished(folder: Path) -> bool:
    try:
        return read_record(folder).get("status") == "finished"
    except InputError:
        return False


def _window_path(folder: Path, index: int) -> Path:
    return folder / WINDOWS / f"{index:04d}.npz"


def _read_windows(folder: Path, run: str) -> list[Checkpoint]:
    """The unbroken sequence of good checkpoints; what follows it is removed."""
    found: list[Checkpoint] = []
    while (path := _window_path(folder, len(found))).is_file():
        try:
            found.append(_read_window(path, run, found))
        except InputError as fault:
            log.warning("%s; going on from window %d", fault, len(found))
            break
    keep = {_window_path(folder, i).name for i in range(len(found))}
    for path in (folder / WINDOWS).iterdir():
        if path.name not in keep:
            path.unlink()
    return found


def _read_window(path: Path, run: str, before: Sequence[Checkpoint]) -> Checkpoint:
    arrays = read_npz(path)
    try:
        facts = json.loads(str(arrays["facts"]))
        stored: dict[str, Any] = {name: arrays[name] for name in _ARRAYS}
        window = Window(**stored, **{name: facts[name] for name in _NUMBERS})
        wall_s = float(facts["wall_s"])
        same_run = facts["run"] == run
        n = window.stop - window.start
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError(
            str(path), f"a checkpoint without {fault}", "a whole one", "none is needed"
        ) from None
    last = before[-1].window if before else None
    follows = (
        same_run
        and window.start == (last.stop if last else 0)
        and window.q.shape == (n + 1, 57)
        and window.v.shape == (n + 1, 56)
        and window.control.shape == window.torque.shape == (n, 50)
        and (last is None or np.array_equal(window.q[0], last.q[-1]))
    )
    if not follows:
        raise InputError(
            str(path), "a window that does not go on from the one before", "one of this run", "none is needed"
        )
    return Checkpoint(window, wall_s)

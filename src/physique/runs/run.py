"""The folder of a run: checkpoints while it goes on, the result when it is done.

`run.json` comes first and says what the run is; each finished window is one file; at the end the
results are written, then `run.json` again with status "finished", and the checkpoints go. Whatever
moment a process is killed at, the folder is either a run to resume or a finished one.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import logging
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from physique.body.bodyfile import load_body, save_body
from physique.body.capsule_body import CapsuleBody
from physique.body.held import parse_held
from physique.body.mesh import BodyMesh
from physique.character.held import HeldGeom, held_geoms
from physique.character.model import TIMESTEP, Character, load_character
from physique.errors import InputError
from physique.store import PathLike, prepare_folder, read_json, read_npz, write_atomic, write_json, write_npz
from physique.tracking.trajectory import Trajectory
from physique.tracking.windows import Window

log = logging.getLogger(__name__)

FORMAT = "physique-run-2"
RECORD, METRICS, TRAJECTORY = "run.json", "metrics.json", "trajectory.npz"
CHARACTER, BODY, BVH, WINDOWS = "character.xml", "body.npz", "motion.bvh", "windows"
POLICY, TREE, TREE_ROUNDS = "policy.npz", "tree.json", "tree"
#: What a run owns in its folder; everything else is left alone.
NAMES = (RECORD, METRICS, TRAJECTORY, CHARACTER, BODY, BVH, WINDOWS, POLICY, TREE, TREE_ROUNDS)

_ARRAYS = ("q", "v", "control", "torque", "shift", "tail_q", "tail_v", "tail_control")
_NUMBERS = ("start", "stop", "cost", "iterations", "sim_steps", "status", "terms")


@dataclass(frozen=True)
class Run:
    """A finished run.

    record: what `run.json` holds: options, seed, versions, fingerprints of the inputs.
    character_xml: the MJCF model that was stepped. body: the capsules that it is made of; mesh:
        their skin, None where the run was made from capsules alone.
    folder: where it is stored, if it is.
    """

    record: dict[str, Any]
    metrics: dict[str, Any]
    trajectory: Trajectory
    character_xml: str
    body: CapsuleBody
    mesh: BodyMesh | None = None
    folder: Path | None = None

    @property
    def success(self) -> bool:
        """Whether the body could follow the motion from beginning to end."""
        return bool(self.metrics["success"])

    @property
    def name(self) -> str:
        """Clip and body, and what it holds."""
        name = f"{self.record['identity']['clip']} on {self.body.name}"
        return f"{name}, {self.holding}" if self.holding else name

    @property
    def holding(self) -> str:
        """What it holds, in words; nothing for empty hands."""
        identity = self.record["identity"]
        if identity.get("hold") is None:
            return ""
        held = parse_held(identity["hold"], identity["hand"])
        hand = "each hand" if held.hand == "both" else f"the {held.hand} hand"
        return f"{held.shape} of {held.mass:g} kg ({held.size:g} m) in {hand}"

    @property
    def timestep(self) -> float:
        """Seconds from one frame to the next."""
        times = self.trajectory.times
        return float(times[1]) if len(times) > 1 else TIMESTEP

    def character(self) -> Character:
        """The body as it was simulated."""
        return load_character(self.character_xml, self.body)

    def held(self) -> tuple[HeldGeom, ...]:
        """The shapes of what it holds."""
        return held_geoms(self.character().model)


@dataclass(frozen=True)
class Checkpoint:
    """A finished window and the seconds of wall time that it took."""

    window: Window
    wall_s: float


def open_run(
    folder: PathLike, record: Mapping[str, Any], *, resume: bool, overwrite: bool
) -> tuple[Path, list[Checkpoint], Run | None]:
    """Start a run in `folder`, or go on with the one in it: its windows so far, and it if finished.

    record: what the run is; a run in the folder that is to be resumed must agree in all of it
    but "threads" and paths. A damaged checkpoint is reported, and the run goes on before it.
    Raises InputError for a folder that cannot be written, that holds a run and neither `resume`
    nor `overwrite` is set, or that holds another run than the one to resume.
    """
    folder = Path(folder)
    held = _held(folder)
    if held and not overwrite:
        if not resume:
            raise InputError(
                str(folder),
                "a finished run" if _finished(folder) else "files of a run",
                "a new or empty folder",
                "choose another --out, add --resume to go on with it or --overwrite to replace it",
            )
        if RECORD in held:
            stored = read_json(folder / RECORD)
            _require_same(folder, stored, record)
            if stored["status"] == "finished":
                shutil.rmtree(folder / WINDOWS, ignore_errors=True)
                return folder, [], load_run(folder)
            prepare_folder(folder / WINDOWS)
            return folder, _read_windows(folder / WINDOWS, fingerprint(record)), None
    folder = prepare_folder(folder)
    if overwrite:
        _clear(folder)
    prepare_folder(folder / WINDOWS)
    write_json(folder / RECORD, {**record, "format": FORMAT, "status": "running"})
    return folder, [], None


def save_window(folder: Path, index: int, checkpoint: Checkpoint, record: Mapping[str, Any]) -> None:
    """Store window number `index` of a run."""
    window = checkpoint.window
    facts = {name: getattr(window, name) for name in _NUMBERS}
    facts |= {"wall_s": checkpoint.wall_s, "run": fingerprint(record)}
    arrays = {name: getattr(window, name) for name in _ARRAYS}
    write_npz(_window_path(folder / WINDOWS, index), {**arrays, "facts": np.array(json.dumps(facts))})


def finish_run(folder: Path, run: Run) -> Run:
    """Write the results of `run` (but the BVH file, see the pipeline) and close the run."""
    write_atomic(folder / CHARACTER, run.character_xml.encode())
    save_body(folder / BODY, run.mesh, run.body)
    write_npz(folder / TRAJECTORY, dataclasses.asdict(run.trajectory))
    write_json(folder / METRICS, run.metrics)
    record = {**run.record, "format": FORMAT, "status": "finished"}
    write_json(folder / RECORD, record)
    shutil.rmtree(folder / WINDOWS, ignore_errors=True)
    return dataclasses.replace(run, record=record, folder=folder)


def load_run(folder: PathLike) -> Run:
    """The finished run in a folder.

    Raises InputError where there is none, it is not finished, or a file is damaged.
    """
    folder = Path(folder)
    if not (folder / RECORD).is_file():
        raise InputError(str(folder), f"no {RECORD}", "the folder of a run", "give the --out folder of a run")
    record = read_json(folder / RECORD)
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(
            str(folder / RECORD), "another format", FORMAT, "make the run anew with this version"
        )
    if record.get("status") != "finished":
        raise InputError(str(folder), "an unfinished run", "a finished one", "finish it with --resume")
    arrays = read_npz(folder / TRAJECTORY)
    names = [field.name for field in dataclasses.fields(Trajectory)]
    missing = [name for name in names if name not in arrays]
    if missing:
        raise InputError(
            str(folder / TRAJECTORY), f"no {', '.join(missing)}", "all arrays", "make the run anew"
        )
    metrics = read_json(folder / METRICS)
    if not isinstance(metrics, dict) or not {"success", "seconds", "windows"} <= metrics.keys():
        raise InputError(str(folder / METRICS), "other data", "metrics of a run", "make the run anew")
    try:
        xml = (folder / CHARACTER).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(str(folder / CHARACTER), str(fault), "an MJCF model", "make the run anew") from None
    mesh, body = load_body(folder / BODY)
    return Run(
        record=record,
        metrics=metrics,
        trajectory=Trajectory(**{name: arrays[name] for name in names}),
        character_xml=xml,
        body=body,
        mesh=mesh,
        folder=folder,
    )


def fingerprint(record: Mapping[str, Any]) -> str:
    """What tells checkpoints of one run from those of another."""
    return hashlib.sha256(json.dumps(record["identity"], sort_keys=True).encode()).hexdigest()


def _held(folder: Path) -> list[str]:
    """The names of a run that are in the folder."""
    try:
        return [name for name in NAMES if (folder / name).exists()] if folder.is_dir() else []
    except OSError as fault:
        raise InputError(
            str(folder), (fault.strerror or str(fault)).lower(), "a folder", "choose another --out"
        ) from None


def _finished(folder: Path) -> bool:
    try:
        return bool(read_json(folder / RECORD)["status"] == "finished")
    except (InputError, KeyError, TypeError):
        return False


def _clear(folder: Path) -> None:
    """Remove the run in the folder; first its record, so that a torso is no run."""
    for name in NAMES:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def _require_same(folder: Path, stored: Any, record: Mapping[str, Any]) -> None:
    """InputError that names the first difference between a stored run and the one asked for."""
    path = folder / RECORD
    if not isinstance(stored, dict) or stored.get("format") != FORMAT or "identity" not in stored:
        raise InputError(str(path), "another format", FORMAT, "choose another --out or add --overwrite")
    # Through JSON, so that both sides have JSON's types.
    wanted = json.loads(json.dumps(record["identity"]))
    names = wanted.keys() | stored["identity"].keys()
    # What the user chose explains more than the fingerprints that follow from it.
    for name in sorted(names, key=lambda name: (name.endswith("sha256"), name)):
        mine, theirs = wanted.get(name), stored["identity"].get(name)
        if mine != theirs:
            raise InputError(
                str(path),
                f"a run with {name.replace('_', ' ')} {_short(theirs)}",
                f"{_short(mine)}, as asked for now",
                "resume with the same options and inputs, choose another --out or add --overwrite",
            )


def _short(value: Any) -> str:
    text = str(value)
    return text[:12] if len(text) == 64 else text


def _window_path(folder: Path, index: int) -> Path:
    return folder / f"{index:04d}.npz"


def _read_windows(folder: Path, run: str) -> list[Checkpoint]:
    """The unbroken sequence of good checkpoints; what follows it is removed."""
    found: list[Checkpoint] = []
    index = 0
    while (path := _window_path(folder, index)).is_file():
        try:
            found.append(_read_window(path, run, found))
        except InputError as fault:
            log.warning("%s; going on from window %d", fault, index)
            break
        index += 1
    keep = {_window_path(folder, i).name for i in range(index)}
    for path in folder.iterdir():
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

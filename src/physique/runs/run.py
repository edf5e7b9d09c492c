"""A finished run, in memory and in its folder. `folder.py` writes one while it is made."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from physique.body.bodyfile import load_body, save_body
from physique.body.capsule_body import CapsuleBody
from physique.body.held import parse_held
from physique.body.mesh import BodyMesh
from physique.character.held import HeldGeom, held_geoms
from physique.character.model import Character, load_character
from physique.character.premises import TIMESTEP
from physique.errors import InputError
from physique.feedback.policy import ControllerName, Policy, make_policy
from physique.feedback.tree import PolicyFile, read_policy
from physique.runs import schema
from physique.store import PathLike, read_json, read_npz, write_atomic, write_json, write_npz
from physique.tracking.trajectory import Trajectory

FORMAT = "physique-run-2"
RECORD, METRICS, TRAJECTORY = "run.json", "metrics.json", "trajectory.npz"
CHARACTER, BODY, BVH, WINDOWS = "character.xml", "body.npz", "motion.bvh", "windows"
POLICY, TREE, TREE_ROUNDS = "policy.npz", "tree.json", "tree"
#: What `load_run` reads: of these `run.json` has the SHA-256.
_READ = (METRICS, TRAJECTORY, CHARACTER, BODY)
#: What a run owns in its folder; everything else is left alone.
NAMES = (RECORD, METRICS, TRAJECTORY, CHARACTER, BODY, BVH, WINDOWS, POLICY, TREE, TREE_ROUNDS)


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

    def policy_file(self) -> PolicyFile | None:
        """What its `policy.npz` holds; None where there is none.

        Raises InputError for a damaged file, and for the policy of another body or motion.
        """
        if self.folder is None or not (path := self.folder / POLICY).is_file():
            return None
        stored, motion = read_policy(path), self.trajectory
        own = stored.xml == self.character_xml and all(
            np.array_equal(there[: stored.tree.frames], here)
            for there, here in ((stored.tree.q, motion.q), (stored.tree.v, motion.v))
        )
        if not own:
            raise InputError(
                str(path),
                "a policy of another motion or body",
                "the run's own",
                f"make it anew with `physique stabilize {self.folder} --overwrite`",
            )
        return stored

    def policy(self, controller: ControllerName | None = None) -> Policy:
        """Its feedback policy; with the tree where it has one, unless `controller` says otherwise.

        Raises InputError for a run without one or without a tree that is asked for, and as
        `policy_file`.
        """
        path = POLICY if self.folder is None else str(self.folder / POLICY)
        stored = self.policy_file()
        if stored is None:
            raise InputError(path, "no policy", "a stabilised run", "make it with `physique stabilize`")
        return make_policy(path, stored, controller)


def load_run(folder: PathLike) -> Run:
    """The finished run in a folder.

    Raises InputError where there is none, it is not finished, or a file is damaged: its arrays
    must have the documented names, types and shapes, be finite, and fit the model. So it does for
    files of another run.
    """
    folder = Path(folder)
    record = read_record(folder)
    if record.get("status") != "finished":
        raise InputError(str(folder), "an unfinished run", "a finished one", "finish it with --resume")
    metrics = read_json(folder / METRICS)
    schema.check_metrics(folder / METRICS, metrics)
    try:
        xml = (folder / CHARACTER).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(str(folder / CHARACTER), str(fault), "an MJCF model", "make the run anew") from None
    mesh, body = load_body(folder / BODY)
    try:
        timestep = float(load_character(xml, body).model.opt.timestep)
    except InputError as fault:
        raise InputError(str(folder / CHARACTER), fault.found, fault.expected, fault.remedy) from None
    trajectory = schema.read_trajectory(folder / TRAJECTORY, read_npz(folder / TRAJECTORY), timestep)
    made = record.get("files_sha256")
    for name, now in _hashes(folder).items():
        if not isinstance(made, dict) or made.get(name) != now:
            raise InputError(
                str(folder / name), "a file that this run did not write", "its own", "make the run anew"
            )
    return Run(
        record=record,
        metrics=metrics,
        trajectory=trajectory,
        character_xml=xml,
        body=body,
        mesh=mesh,
        folder=folder,
    )


def protect_runs(path: Path) -> None:
    """Raise InputError where writing the file `path` would replace a part of a run."""
    if path.name in NAMES and (path.parent / RECORD).is_file():
        raise InputError(
            str(path), "a file of the run in this folder", "another name or folder", "correct the path"
        )


def _hashes(folder: Path) -> dict[str, str]:
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in _READ}


def read_record(folder: Path) -> dict[str, Any]:
    """The `run.json` of a run, finished or not. Raises InputError where there is none of this
    version."""
    if not (folder / RECORD).is_file():
        raise InputError(str(folder), f"no {RECORD}", "the folder of a run", "give the --out folder of a run")
    record = read_json(folder / RECORD)
    schema.check_record(folder / RECORD, record, FORMAT)
    return dict(record)


def finish_run(folder: Path, run: Run) -> Run:
    """Write the results of `run` (but the BVH file, see the command) and close the run."""
    write_atomic(folder / CHARACTER, run.character_xml.encode())
    save_body(folder / BODY, run.mesh, run.body)
    write_npz(folder / TRAJECTORY, dataclasses.asdict(run.trajectory))
    write_json(folder / METRICS, run.metrics)
    record = {**run.record, "format": FORMAT, "status": "finished", "files_sha256": _hashes(folder)}
    write_json(folder / RECORD, record)
    return dataclasses.replace(run, record=record, folder=folder)

"""Clip + body -> physically simulated motion: the whole flow, one call a stage."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from physique.body.held import Held
from physique.body.mesh import BodyMesh
from physique.character import kinematics
from physique.character.joint_error import mean_joint_error
from physique.character.model import Character, make_character
from physique.character.start import start_state
from physique.commands.inputs import BodyLike, TorqueLimit, find_body, find_limits
from physique.errors import InputError
from physique.export.bvh import write_body_bvh
from physique.motion.clip import Motion
from physique.motion.read import read_clip, read_motion
from physique.provenance import digest, versions
from physique.reference.reference import Reference, make_reference
from physique.reference.target import Weights, upright_weights
from physique.runs import metrics
from physique.runs.folder import Checkpoint, RunFolder, open_run
from physique.runs.run import BVH, Run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.simulation.simulator import Simulator
from physique.store import PathLike
from physique.tracking import cma, ddp
from physique.tracking.problem import Problem, Solution
from physique.tracking.trajectory import Trajectory, join
from physique.tracking.windows import Optimizer, Schedule, Window, track

log = logging.getLogger(__name__)

OptimizerName = Literal["fast", "paper"]

_MOST_THREADS = 8  # a window is too small a job for more
_ANY_THREADS = 256
#: What each optimiser looks ahead and keeps. The paper's is a pair of windows of 0.4 s.
SCHEDULES: dict[OptimizerName, Schedule] = {"fast": Schedule(), "paper": Schedule(0.8, 0.4, careful=0.4)}
_SHORTEST_HORIZON = 0.2  # s
_LONGEST_HORIZON = 5.0  # s


@dataclass(frozen=True)
class RetargetOptions:
    """What decides a run, besides the clip and the body. Raises InputError for what cannot be.

    fps: the recording's true frame rate, where its header is wrong. start, end: s, the part.
    mapping: a TOML file for a skeleton that is not recognised. These four belong to the reading of
        a clip and are not used for a motion that was read.
    optimizer: "fast" (derivatives) or "paper" (CMA as published; about a thousand times dearer).
    torque_limit: "body", limits that fit the person's mass and stature, or Nm for all joints.
    horizon: s that each window looks ahead. weights: of the terms of E (Eq. 2); left out,
        `upright_weights`, or the paper's with the paper's optimiser.
    hold: an object in a hand or one in each; the performer holds none. seed: of all random draws.
    """

    fps: float | None = None
    start: float | None = None
    end: float | None = None
    mapping: Path | None = None
    optimizer: OptimizerName = "fast"
    torque_limit: TorqueLimit = "body"
    horizon: float | None = None
    weights: Weights | None = None
    hold: Held | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.optimizer not in get_args(OptimizerName):
            raise InputError("optimizer", repr(self.optimizer), "fast or paper", "choose one of the two")
        longest, horizon = _LONGEST_HORIZON, self.horizon
        if horizon is not None and not _SHORTEST_HORIZON <= horizon <= longest:
            found, expected = f"{horizon:g} s", f"{_SHORTEST_HORIZON:g} to {longest:g} s"
            raise InputError("horizon", found, expected, "correct the value")
        if self.seed < 0 or self.seed >= 2**32:
            raise InputError("seed", str(self.seed), "0 to 4294967295", "correct the value")

    @property
    def cost_weights(self) -> Weights:
        """The weights of E."""
        return self.weights or own_weights(self.optimizer)

    @property
    def schedule(self) -> Schedule:
        """What windows look ahead and keep."""
        schedule = SCHEDULES[self.optimizer]
        if self.horizon is None:
            return schedule
        horizon = float(self.horizon)
        # Nothing is kept that was not looked at.
        return replace(schedule, horizon=horizon, commit=min(schedule.commit, horizon))

    @property
    def identity(self) -> dict[str, Any]:
        """All of it for `run.json`."""
        schedule, hold = self.schedule, self.hold
        return {
            "fps": self.fps,
            "start": self.start,
            "end": self.end,
            "optimizer": self.optimizer,
            "torque_limit": self.torque_limit,
            **{f"weight_{name}": value for name, value in self.cost_weights.terms.items()},
            "joint_weights_sha256": digest(self.cost_weights.joints),
            "hold": None if hold is None else str(hold),
            "hand": None if hold is None else hold.hand,
            "horizon": schedule.horizon,
            "commit": schedule.commit,
            "careful_commit": schedule.careful,
            "hard": schedule.hard,
            "seed": self.seed,
        }


def own_weights(optimizer: OptimizerName) -> Weights:
    """What an optimiser minimises unless told otherwise."""
    return Weights() if optimizer == "paper" else upright_weights()


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    name: clip and body. done, total: s of the motion. window: its number. iteration: of the
    optimiser in it. cost: E so far of the window.
    error: m, mean joint error of the window that was finished last; None before there is one.
    """

    name: str
    done: float
    total: float
    window: int
    iteration: int
    cost: float | None
    error: float | None


@dataclass(frozen=True)
class _Task:
    """A character that is to perform a reference from the state q0 (57,), v0 (56,)."""

    character: Character
    mesh: BodyMesh | None
    reference: Reference
    q0: np.ndarray
    v0: np.ndarray
    options: RetargetOptions
    record: dict[str, Any]
    threads: int


def retarget(
    clip: str | Path | Motion,
    body: BodyLike = "average",
    options: RetargetOptions | None = None,
    *,
    threads: int | None = None,
    out: PathLike | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[Progress], None] | None = None,
    **changes: Any,
) -> Run:
    """Make the body perform the clip under physics.

    clip: a file, an embedded clip's name or a motion that was read.
    body: a ready body's name, a body file, a mesh or a capsule body.
    options: what else decides the run; its defaults if left out. changes: fields of it by name, as
        in `retarget("walk", "heavy", end=1.0, torque_limit=100)`.
    threads: that simulate; all processors, up to 8, if left out. They do not change the result.
    out: a folder; finished windows are kept there, so that a run that was stopped goes on with
        `resume`, to the same bits. `overwrite` replaces a run that is there.

    A body that cannot follow gives a run too: see `Run.success` and its metrics. Raises InputError
    for input that cannot be used, before anything is written.
    """
    options = replace(options or RetargetOptions(), **changes)
    task = _prepare(clip, body, options, _threads(threads))
    if out is None:
        return _perform(task, None, progress)
    with open_run(out, task.record, resume=resume, overwrite=overwrite) as folder:
        if folder.finished is not None:
            return folder.finished
        run = _perform(task, folder, progress)
        export_bvh(folder.path / BVH, task.character, run.trajectory)
        return folder.finish(run)


def _prepare(clip: str | Path | Motion, body: BodyLike, options: RetargetOptions, threads: int) -> _Task:
    """All that comes before the first window."""
    if isinstance(clip, Motion):
        motion, clip_sha256 = clip, digest(clip, ("source",))
    else:
        source = read_clip(clip)
        # Of the content, so that line ends and the clip's place on disk do not matter.
        clip_sha256 = digest(source, skip=("name", "source"))
        motion = read_motion(
            source, fps=options.fps, start=options.start, end=options.end, mapping=options.mapping
        )
    mesh, capsules = find_body(body)
    character = make_character(capsules, find_limits(options.torque_limit, capsules), options.hold)
    reference = make_reference(motion, character)
    if reference.frames < 2:
        raise InputError(
            motion.source,
            f"{motion.frames} frames, {motion.seconds:.3f} s",
            f"more than {reference.timestep:g} s of motion",
            "choose a longer part of the clip",
        )
    record = {
        "identity": {
            "clip": motion.name,
            "clip_sha256": clip_sha256,
            "motion_sha256": digest(reference),
            "body": capsules.name,
            "body_sha256": digest(capsules),
            "character_sha256": digest(character.xml),
            **options.identity,
            "versions": versions(),
        },
        "clip_source": motion.source,
        "mapping": None if options.mapping is None else str(options.mapping),
        "threads": threads,
    }
    q0, v0 = start_state(character, reference.q[0], reference.v[0], reference.contacts[0])
    return _Task(character, mesh, reference, q0, v0, options, record, threads)


def _perform(task: _Task, folder: RunFolder | None, progress: Callable[[Progress], None] | None) -> Run:
    """The run; its windows are kept in the folder as they come."""
    done = () if folder is None else folder.checkpoints
    checkpoints = [*done, *_track(task, done, folder, progress)]
    trajectory = join(task.reference, task.q0, task.v0, [c.window for c in checkpoints])
    report, hold = _report(task, trajectory, checkpoints), task.options.hold
    report["held_mass_kg"] = 0.0 if hold is None else hold.mass * len(hold.hands)
    return Run(task.record, report, trajectory, task.character.xml, task.character.body, task.mesh)


def export_bvh(path: PathLike, character: Character, trajectory: Trajectory) -> Path:
    """Write the simulated motion as a BVH file of the body's own skeleton."""
    fps = 1.0 / float(character.model.opt.timestep)
    return write_body_bvh(path, character.body.joints, trajectory.q, fps)


def _track(
    task: _Task,
    done: Sequence[Checkpoint],
    folder: RunFolder | None,
    progress: Callable[[Progress], None] | None,
) -> list[Checkpoint]:
    """The windows that are not done yet, each stored as soon as it is."""
    character, reference, options = task.character, task.reference, task.options
    found: list[Checkpoint] = []
    total = (reference.frames - 1) * reference.timestep
    error: float | None = None
    name = f"{reference.name} on {character.body.name}"

    def tell(iteration: int, cost: float | None) -> None:
        if progress is not None:
            last = (found or done)[-1].window.stop if found or done else 0
            at = last * reference.timestep
            progress(Progress(name, at, total, len(done) + len(found), iteration, cost, error))

    tell(0, None)
    with quiet(), MujocoSimulator(character, task.threads) as simulator:
        windows = track(
            character,
            reference,
            task.q0,
            task.v0,
            simulator,
            _optimizer(options, tell),
            options.schedule,
            options.cost_weights,
            [c.window for c in done],
        )
        clock = time.perf_counter()
        for window in windows:
            if not math.isfinite(window.cost):
                log.warning(
                    "the simulation blew up at %.2f s; the motion ends there",
                    window.start * reference.timestep,
                )
                break
            now = time.perf_counter()
            checkpoint = Checkpoint(window, now - clock)
            clock = now
            if folder is not None:
                folder.save(len(done) + len(found), checkpoint)
            found.append(checkpoint)
            error = _error(character, reference, window)
            tell(0, window.cost)
    return found


def _optimizer(options: RetargetOptions, tell: Callable[[int, float | None], None]) -> Optimizer:
    def paper(problem: Problem, simulator: Simulator, nominal: Any) -> Solution:
        return cma.solve(problem, simulator, nominal, cma.CmaOptions(seed=options.seed), tell)

    def fast(problem: Problem, simulator: Simulator, nominal: Any) -> Solution:
        return ddp.solve(problem, simulator, nominal, ddp.DdpOptions(hard=options.schedule.hard), tell)

    return paper if options.optimizer == "paper" else fast


def _error(character: Character, reference: Reference, window: Window) -> float:
    """Mean joint error, m, of a window's kept frames."""
    joints = kinematics.joint_positions(character, window.q[1:])
    wanted = reference.joints[window.start + 1 : window.stop + 1] + np.array([*window.shift, 0])
    return mean_joint_error(joints, wanted)


def _report(task: _Task, trajectory: Trajectory, checkpoints: Sequence[Checkpoint]) -> dict[str, Any]:
    """All metrics: those of the motion, and what it took to find it."""
    windows = [c.window for c in checkpoints]
    character, options = task.character, task.options
    report = metrics.measure(character, task.reference, trajectory, windows, options.cost_weights)
    for entry, checkpoint in zip(report["windows"], checkpoints):
        entry["wall_s"] = checkpoint.wall_s
    steps = sum(w.sim_steps for w in windows)
    wall = sum(c.wall_s for c in checkpoints)
    seconds = report["seconds"]
    return {
        **report,
        "body_height_m": character.body.height,
        "body_mass_kg": character.body.mass,
        "sim_steps": steps,
        "sim_steps_per_motion_s": steps / seconds if seconds else None,
        "wall_s": wall,
        "wall_s_per_motion_s": wall / seconds if seconds else None,
        "seed": options.seed,
        "versions": versions(),
    }


def _threads(threads: int | None) -> int:
    if threads is None:
        return min(os.cpu_count() or 1, _MOST_THREADS)
    if not 1 <= threads <= _ANY_THREADS:
        raise InputError("threads", str(threads), f"1 to {_ANY_THREADS}", "correct the value")
    return threads

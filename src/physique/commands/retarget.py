"""Clip + body -> physically simulated motion: the whole flow, one call a stage."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from physique.body.held import Held
from physique.character import kinematics
from physique.character.model import Character, make_character
from physique.character.start import start_state
from physique.commands.inputs import (
    BodyLike,
    TorqueLimit,
    clip_hash,
    digest,
    find_body,
    find_limits,
    versions,
)
from physique.errors import InputError
from physique.export.bvh import write_body_bvh
from physique.motion.clip import Motion
from physique.motion.read import read_motion
from physique.reference.reference import Reference, make_reference
from physique.reference.target import Weights
from physique.runs import metrics, run
from physique.runs.run import Checkpoint, Run
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
#: What each optimiser looks ahead and keeps. The paper's is a pair of windows of 0.4 s.
SCHEDULES: dict[OptimizerName, Schedule] = {"fast": Schedule(), "paper": Schedule(0.8, 0.4, careful=0.4)}
_SHORTEST_HORIZON = 0.2  # s
_LONGEST_HORIZON = 5.0  # s


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


def retarget(
    clip: str | Path | Motion,
    body: BodyLike = "average",
    *,
    fps: float | None = None,
    start: float | None = None,
    end: float | None = None,
    mapping: Path | None = None,
    optimizer: OptimizerName = "fast",
    torque_limit: TorqueLimit = "body",
    horizon: float | None = None,
    weights: Weights | None = None,
    hold: Held | None = None,
    seed: int = 0,
    threads: int | None = None,
    out: PathLike | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Run:
    """Make the body perform the clip under physics.

    clip: a file, an embedded clip's name or a motion that was read (then `fps`, `start`, `end` and
        `mapping`, which belong to the reading, are not used).
    body: a ready body's name, a body file, a mesh or a capsule body.
    fps: the recording's true frame rate, where its header is wrong. start, end: s, the part.
    mapping: a TOML file for a skeleton that is not recognised.
    optimizer: "fast" (derivatives) or "paper" (CMA as published; about a thousand times dearer).
    torque_limit: "body", limits that fit the person's mass and stature, or Nm for all joints.
    horizon: s that each window looks ahead. weights: of the terms of E (Eq. 2).
    hold: an object in a hand or one in each; the performer holds none. seed: of all random draws.
    threads: that simulate; all processors, up to 8, if left out. They do not change the result.
    out: a folder; finished windows are kept there, so that a run that was stopped goes on with
        `resume`, to the same bits. `overwrite` replaces a run that is there.

    A body that cannot follow gives a run too: see `Run.success` and its metrics. Raises InputError
    for input that cannot be used, before anything is written.
    """
    schedule = _schedule(optimizer, horizon)
    weights = weights or Weights()
    workers = _threads(threads)
    _check_seed(seed)
    motion = read_clip_part(clip, fps, start, end, mapping)
    mesh, capsules = find_body(body)
    limits = find_limits(torque_limit, capsules)
    character = make_character(capsules, limits, hold)
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
            "clip_sha256": digest(motion, ("source",)) if isinstance(clip, Motion) else clip_hash(clip),
            "motion_sha256": digest(reference),
            "body": capsules.name,
            "body_sha256": digest(capsules),
            "character_sha256": digest(character.xml),
            "fps": fps,
            "start": start,
            "end": end,
            "optimizer": optimizer,
            "torque_limit": torque_limit,
            **{f"weight_{name}": value for name, value in weights.terms.items()},
            "joint_weights_sha256": digest(weights.joints),
            "hold": None if hold is None else str(hold),
            "hand": None if hold is None else hold.hand,
            "horizon": schedule.horizon,
            "commit": schedule.commit,
            "careful_commit": schedule.careful,
            "hard": schedule.hard,
            "seed": seed,
            "versions": versions(),
        },
        "clip_source": motion.source,
        "mapping": None if mapping is None else str(mapping),
        "threads": workers,
    }
    q0, v0 = start_state(character, reference.q[0], reference.v[0], reference.contacts[0])
    folder: Path | None = None
    done: list[Checkpoint] = []
    if out is not None:
        folder, done, finished = run.open_run(out, record, resume=resume, overwrite=overwrite)
        if finished is not None:
            return finished
    checkpoints = done + _track(
        character,
        reference,
        q0,
        v0,
        schedule,
        weights,
        optimizer,
        seed,
        workers,
        folder,
        record,
        done,
        progress,
    )
    windows = [c.window for c in checkpoints]
    trajectory = join(reference, q0, v0, windows)
    report = _report(character, reference, trajectory, checkpoints, weights, seed)
    report["held_mass_kg"] = 0.0 if hold is None else hold.mass * len(hold.hands)
    result = Run(record, report, trajectory, character.xml, capsules, mesh)
    if folder is None:
        return result
    export_bvh(folder / run.BVH, character, trajectory)
    return run.finish_run(folder, result)


def read_clip_part(
    clip: str | Path | Motion, fps: float | None, start: float | None, end: float | None, mapping: Path | None
) -> Motion:
    """`read_motion`, or the motion itself."""
    if isinstance(clip, Motion):
        return clip
    return read_motion(clip, fps=fps, start=start, end=end, mapping=mapping)


def export_bvh(path: PathLike, character: Character, trajectory: Trajectory) -> Path:
    """Write the simulated motion as a BVH file of the body's own skeleton."""
    fps = 1.0 / float(character.model.opt.timestep)
    return write_body_bvh(path, character.body.joints, trajectory.q, fps)


def _track(
    character: Character,
    reference: Reference,
    q0: np.ndarray,
    v0: np.ndarray,
    schedule: Schedule,
    weights: Weights,
    optimizer: OptimizerName,
    seed: int,
    threads: int,
    folder: Path | None,
    record: dict[str, Any],
    done: list[Checkpoint],
    progress: Callable[[Progress], None] | None,
) -> list[Checkpoint]:
    """The windows that are not done yet, each stored as soon as it is."""
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
    with quiet(), MujocoSimulator(character, threads) as simulator:
        windows = track(
            character,
            reference,
            q0,
            v0,
            simulator,
            _optimizer(optimizer, schedule.hard, seed, tell),
            schedule,
            weights,
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
                run.save_window(folder, len(done) + len(found), checkpoint, record)
            found.append(checkpoint)
            error = _error(character, reference, window)
            tell(0, window.cost)
    return found


def _optimizer(
    name: OptimizerName, hard: float, seed: int, tell: Callable[[int, float | None], None]
) -> Optimizer:
    if name == "paper":
        options = cma.CmaOptions(seed=seed)

        def paper(problem: Problem, simulator: Simulator, nominal: Any) -> Solution:
            return cma.solve(problem, simulator, nominal, options, tell)

        return paper

    def fast(problem: Problem, simulator: Simulator, nominal: Any) -> Solution:
        return ddp.solve(problem, simulator, nominal, ddp.DdpOptions(hard=hard), tell)

    return fast


def _error(character: Character, reference: Reference, window: Window) -> float:
    """Mean joint error, m, of a window's kept frames."""
    joints = kinematics.joint_positions(character, window.q[1:])
    wanted = reference.joints[window.start + 1 : window.stop + 1] + np.array([*window.shift, 0])
    return float(metrics.joint_errors(joints, wanted).mean())


def _report(
    character: Character,
    reference: Reference,
    trajectory: Trajectory,
    checkpoints: list[Checkpoint],
    weights: Weights,
    seed: int,
) -> dict[str, Any]:
    """All metrics: those of the motion, and what it took to find it."""
    windows = [c.window for c in checkpoints]
    report = metrics.measure(character, reference, trajectory, windows, weights)
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
        "seed": seed,
        "versions": versions(),
    }


def _schedule(optimizer: OptimizerName, horizon: float | None) -> Schedule:
    if optimizer not in get_args(OptimizerName):
        raise InputError("optimizer", repr(optimizer), "fast or paper", "choose one of the two")
    schedule = SCHEDULES[optimizer]
    if horizon is None:
        return schedule
    if not (math.isfinite(horizon) and _SHORTEST_HORIZON <= horizon <= _LONGEST_HORIZON):
        raise InputError(
            "horizon",
            f"{horizon:g} s",
            f"{_SHORTEST_HORIZON:g} to {_LONGEST_HORIZON:g} s",
            "correct the value",
        )
    # Nothing is kept that was not looked at.
    return replace(schedule, horizon=float(horizon), commit=min(schedule.commit, float(horizon)))


def _threads(threads: int | None) -> int:
    if threads is None:
        return min(os.cpu_count() or 1, _MOST_THREADS)
    if threads < 1:
        raise InputError("threads", str(threads), "at least 1", "correct the value")
    return threads


def _check_seed(seed: int) -> None:
    if seed < 0 or seed >= 2**32:
        raise InputError("seed", str(seed), "0 to 4294967295", "correct the value")

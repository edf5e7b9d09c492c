"""From a run to a controller that survives pushes: stabilise it, grow a tree, push it."""

from __future__ import annotations

import json
import logging
import math
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from physique.errors import InputError
from physique.feedback import growth
from physique.feedback.connect import make_trunk
from physique.feedback.grow import Settings
from physique.feedback.lqr import WeightsName
from physique.feedback.policy import ControllerName, Policy, load_policy
from physique.feedback.pushes import Trial, random_pushes, run_trials
from physique.feedback.tree import read_policy, save_policy
from physique.runs import run as runs
from physique.runs.run import Run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.store import PathLike, read_json, write_json

log = logging.getLogger(__name__)

#: Pushes come at the latest this long before the motion's end, so that a fall is seen.
MARGIN = 1.5  # s
_MOST_WORKERS = 8


def stabilize(folder: PathLike, weights: WeightsName = "default") -> Policy:
    """Put `policy.npz`, LQR along the motion, into a run's folder; the policy comes back.

    weights: "default", chosen by measured survival, or "paper", those of section 4.1. A policy that
    is there is replaced. Raises InputError for what is no finished run.
    """
    if weights not in get_args(WeightsName):
        raise InputError("weights", repr(weights), "default or paper", "choose one of the two")
    run = _load(folder)
    character, motion = run.character(), run.trajectory
    with quiet(), MujocoSimulator(character, 1) as simulator:
        trunk = make_trunk(simulator, motion.q, motion.v, motion.control, weights)
    path = Path(folder) / runs.POLICY
    save_policy(path, run.character_xml, growth.root(trunk), {**_about(run), "weights": weights})
    return load_policy(path)


def grow_tree(
    folder: PathLike,
    settings: Settings | None = None,
    *,
    weights: WeightsName = "default",
    workers: int | None = None,
    resume: bool = False,
    progress: Callable[[growth.GrowthProgress], None] | None = None,
) -> dict[str, Any]:
    """Grow a tree about a run's motion (Algorithm 1) into its `policy.npz`; what `tree.json` says
    of it comes back.

    settings: h, F and Lambda; the defaults of `Settings` if left out.
    workers: processes, as many as processors (up to 8) if left out; they do not change the tree.
    resume: go on with a growth that was stopped; a tree that is finished stays as it is. Raises
    InputError for what is no finished run and for a growth in the folder that is not to be, or
    cannot be, resumed.
    """
    if workers is None:
        workers = min(os.cpu_count() or 1, _MOST_WORKERS)
    if workers < 1:
        raise InputError("workers", str(workers), "at least 1", "correct the value")
    settings = settings or Settings()
    run = _load(folder)
    motion, rounds = run.trajectory, Path(folder) / runs.TREE_ROUNDS
    if resume and not rounds.is_dir() and _has_tree(run, Path(folder), settings, weights):
        log.warning("%s: the tree is finished", Path(folder) / runs.TREE)
        return dict(read_json(Path(folder) / runs.TREE))
    grown = growth.grow(
        run.character(),
        motion.q,
        motion.v,
        motion.control,
        weights,
        settings,
        rounds,
        workers=workers,
        resume=resume,
        progress=progress,
    )
    report = tree_report(grown, settings)
    save_policy(
        Path(folder) / runs.POLICY,
        run.character_xml,
        grown.tree,
        {**_about(run), "weights": weights, "tree": report["settings"]},
    )
    write_json(Path(folder) / runs.TREE, report)
    shutil.rmtree(rounds, ignore_errors=True)
    return report


def _has_tree(run: Run, folder: Path, settings: Settings, weights: WeightsName) -> bool:
    """Whether the run's policy has a finished tree. Raises InputError for one of other options."""
    path = folder / runs.POLICY
    if not (path.is_file() and (folder / runs.TREE).is_file()):
        return False
    xml, tree, head = read_policy(path)
    motion = tree.q[: tree.frames]
    if "tree" not in head or xml != run.character_xml:
        return False
    if not np.array_equal(motion, run.trajectory.q):
        return False
    wanted = json.loads(json.dumps({"tree": asdict(settings), "weights": weights}))
    if {name: head.get(name) for name in wanted} != wanted:
        raise InputError(
            str(folder / runs.TREE),
            "a finished tree of other options",
            "none, or the same",
            "leave out --resume to grow another in its place",
        )
    return True


def tree_report(grown: growth.Growth, settings: Settings) -> dict[str, Any]:
    """Perturbed states and nodes of each subtree, from the motion's end on, and the price."""
    subtrees: dict[int, dict[str, Any]] = {}
    for round_, done in grown.rounds:
        entry = subtrees.setdefault(
            round_.frame,
            {
                "timestep": round_.frame,
                "trials": 0,
                "covered": 0,
                "failed": 0,
                "perturbed_states": 0,
                "nodes": 0,
            },
        )
        entry["trials"] += round_.count
        entry["covered"] += done.covered
        entry["failed"] += done.failed
        entry["perturbed_states"] += len(done.nodes)
        entry["nodes"] += sum(done.nodes)
    total = [done for _, done in grown.rounds]
    return {
        "settings": asdict(settings),
        "subtrees": list(subtrees.values()),
        "perturbed_states": grown.tree.branches,
        "nodes": len(grown.tree.q) - grown.tree.frames,
        "trials": sum(r.count for r, _ in grown.rounds),
        "covered": sum(d.covered for d in total),
        "failed": sum(d.failed for d in total),
        "sim_steps": sum(d.steps for d in total),
        "seconds": sum(d.seconds for d in total),
        "cpu_seconds": sum(d.cpu for d in total),
    }


@dataclass(frozen=True)
class PushReport:
    """Trials of one impulse; the fields are the keys of `physique push --json`.

    survival: 0 to 1. median_recovery_s: of those that survived; None where half of them or more
    have not recovered by the motion's end. delta_v: m/s, impulse by mass. decision_ms: of one
    online decision, None without one. realtime_factor: s of motion a second of wall time.
    """

    trials: int
    survived: int
    survival: float
    median_recovery_s: float | None
    impulse_ns: float
    delta_v: float
    decision_ms: dict[str, float] | None
    realtime_factor: float


def push(
    folder: PathLike,
    impulse: float,
    *,
    duration: float = 0.1,
    trials: int = 100,
    seed: int = 0,
    controller: ControllerName | None = None,
    start: float | None = None,
    end: float | None = None,
    on_trial: Callable[[int, Trial], None] | None = None,
) -> tuple[PushReport, list[Trial]]:
    """Push a run's character at random and see whether it survives.

    impulse: Ns, on a random part in a random direction, over `duration` s, beginning at a random
        time between start and end, s; left out, from the beginning to 1.5 s before the motion's
        end. seed: of the pushes. controller: left out, the best that the policy has.

    Survival: the mean body position error is at most 0.5 m until the motion's end. Raises
    InputError for a run without a policy and for values that do not fit it.
    """
    path = Path(folder) / runs.POLICY
    run = _load(folder)
    if not path.is_file():
        raise InputError(str(path), "no policy", "a stabilised run", "make it with `physique stabilize`")
    policy = load_policy(path, controller)
    if policy.model_xml != run.character_xml:
        raise InputError(
            str(path), "a policy of another run", "this run's", "make it with `physique stabilize`"
        )
    _check("impulse", impulse, 0.0, 1e5, "Ns")
    _check("duration", duration, policy.timestep, policy.seconds, "s")
    _check("trials", trials, 1, 1e6, "")
    _check("seed", seed, 0, 2**32 - 1, "")
    last = policy.seconds - duration
    first_s = 0.0 if start is None else start
    last_s = max(first_s, policy.seconds - MARGIN) if end is None else end
    _check("from", first_s, 0.0, last, "s")
    _check("to", last_s, first_s, last, "s")
    pushes = random_pushes(
        np.random.default_rng(seed),
        trials,
        impulse,
        max(1, round(duration / policy.timestep)),
        (round(first_s / policy.timestep), round(last_s / policy.timestep)),
        policy.timestep,
    )
    character = run.character()
    with quiet(), MujocoSimulator(character, 1) as simulator:
        done, factor = run_trials(simulator, policy, pushes, on_trial)
    return report(done, impulse, character.mass, factor), done


def report(trials: list[Trial], impulse: float, mass: float, factor: float) -> PushReport:
    """The trials in a few numbers."""
    survived = sum(t.survived for t in trials)
    recovery = [math.inf if t.recovery is None else t.recovery for t in trials if t.survived]
    middle = float(np.median(recovery)) if recovery else math.inf
    decisions = [1e3 * s for t in trials for s in t.decisions]
    return PushReport(
        trials=len(trials),
        survived=survived,
        survival=survived / len(trials),
        median_recovery_s=middle if math.isfinite(middle) else None,
        impulse_ns=impulse,
        delta_v=impulse / mass,
        decision_ms={"median": float(np.median(decisions)), "worst": max(decisions)} if decisions else None,
        realtime_factor=factor,
    )


def _load(folder: PathLike) -> Run:
    run = runs.load_run(folder)
    if run.trajectory.frames < 3:
        raise InputError(
            str(folder),
            f"a motion of {run.trajectory.frames} frames",
            "at least 3",
            "retarget a longer part of the clip",
        )
    return run


def _about(run: Run) -> dict[str, Any]:
    return {"clip": run.record["identity"]["clip"], "body": run.record["identity"]["body"]}


def _check(name: str, value: float, least: float, most: float, unit: str) -> None:
    if not (math.isfinite(value) and least <= value <= most + 1e-9):
        raise InputError(
            f"--{name}", f"{value:g} {unit}", f"{least:g} to {most:g} {unit}", "correct the value"
        )

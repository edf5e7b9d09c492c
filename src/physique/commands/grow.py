"""A tree of controllers about a run's motion, grown into its `policy.npz`."""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from physique.commands.stabilize import require_motion, warn_policy_replaced, write_policy
from physique.errors import InputError
from physique.feedback import growth
from physique.feedback.grow import Settings
from physique.feedback.lqr import WeightsName
from physique.runs.folder import change_run, check_choice, describe, warn_replaced
from physique.runs.run import POLICY, TREE, TREE_ROUNDS, Run
from physique.store import PathLike, read_json, write_json

log = logging.getLogger(__name__)

_MOST_WORKERS = 8


def grow_tree(
    folder: PathLike,
    settings: Settings | None = None,
    *,
    weights: WeightsName | None = None,
    workers: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[growth.GrowthProgress], None] | None = None,
) -> dict[str, Any]:
    """Grow a tree about a run's motion (Algorithm 1) into its `policy.npz`; what `tree.json` says
    of it comes back.

    settings: h, F and Lambda; the defaults of `Settings` if left out. weights: of the LQR; those
    of the policy that is there, or "default", if left out.
    workers: processes, as many as processors (up to 8) if left out; they do not change the tree.
    resume: go on with a growth that was stopped; a tree that is finished stays as it is.
    overwrite: replace a tree, or a policy of other weights, when the new tree is done, and a growth
    that was stopped at once. Raises InputError for what is no finished run, for what would be
    replaced without `overwrite`, and for a growth that cannot be resumed.
    """
    check_choice(resume, overwrite)
    if workers is None:
        workers = min(os.cpu_count() or 1, _MOST_WORKERS)
    if workers < 1:
        raise InputError("workers", str(workers), "at least 1", "correct the value")
    if weights is not None and weights not in get_args(WeightsName):
        raise InputError("weights", repr(weights), "default or paper", "choose one of the two")
    settings = settings or Settings()
    with change_run(folder) as run:
        require_motion(run)
        folder = Path(folder)
        rounds = folder / TREE_ROUNDS
        weights = _weights(run, weights, overwrite)
        wanted = {"tree": asdict(settings), "weights": weights}
        # A growth that was stopped had leave to replace what is there when it began.
        if not (overwrite or (resume and rounds.is_dir())) and _is_grown(run, wanted, resume):
            log.warning("%s: the tree is finished", folder / TREE)
            return _read_tree(folder / TREE)
        if overwrite and rounds.is_dir():
            warn_replaced(folder, [TREE_ROUNDS])
            shutil.rmtree(rounds)
        # A tree contains the plain policy of the same weights.
        if overwrite or (folder / TREE).exists():
            warn_policy_replaced(run)
        motion = run.trajectory
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
        if not report["perturbed_states"]:
            log.warning(
                "%s: the motion's own feedback stood all %d pushes; the tree has no branches",
                folder,
                report["trials"],
            )
        write_policy(run, grown.tree, wanted)
        write_json(folder / TREE, report)
        shutil.rmtree(rounds, ignore_errors=True)
        return report


def _read_tree(path: Path) -> dict[str, Any]:
    """What a finished tree's `tree.json` says. Raises InputError where it says something else."""
    tree = read_json(path)
    names = ("trials", "covered", "perturbed_states", "nodes", "failed")
    parts = tree.get("subtrees") if isinstance(tree, dict) else None
    whole = isinstance(parts, list) and all(
        isinstance(one, dict) and all(isinstance(one.get(name), int | float) for name in wanted)
        for one, wanted in [
            (tree, (*names, "sim_steps", "seconds")),
            *((part, (*names, "timestep")) for part in parts),
        ]
    )
    if not whole:
        raise InputError(str(path), "other data", "the report of a tree", "grow it anew with --overwrite")
    return dict(tree)


def _weights(run: Run, asked: WeightsName | None, overwrite: bool) -> WeightsName:
    """Those that are asked for, or those of the policy that is there.

    Raises InputError where these differ and nothing is to be replaced.
    """
    try:
        stored = run.policy_file()
    except InputError:
        if not overwrite:
            raise
        stored = None
    if stored is None:
        return asked or "default"
    there: WeightsName = stored.facts.get("weights", "default")
    if asked is None:
        if there != "default":
            log.warning("%s: growing with its weights, %s", run.folder, there)
        return there
    if asked != there and not overwrite:
        raise InputError(
            f"{run.folder}/{POLICY}",
            f"a policy of the weights {there}",
            f"{asked}, as asked for now",
            "leave out --weights to use those that are there, or add --overwrite",
        )
    return asked


def _is_grown(run: Run, wanted: dict[str, Any], resume: bool) -> bool:
    """Whether the run has just this tree, to be left alone; false where it has none.

    Raises InputError for another, and for this one without `resume`.
    """
    stored = run.policy_file()
    assert run.folder is not None
    if stored is None or "tree" not in stored.facts:
        return False
    same = {name: stored.facts.get(name) for name in wanted} == json.loads(json.dumps(wanted))
    if resume and same and (run.folder / TREE).is_file():
        return True
    raise InputError(
        str(run.folder / POLICY),
        f"a finished tree{'' if same else ' of other options'}, {describe(run.folder, TREE)}",
        "none" if not resume else "none, or the same",
        "keep it, or add --overwrite to grow another in its place",
    )


def tree_report(grown: growth.Growth, settings: Settings) -> dict[str, Any]:
    """Perturbed states and nodes of each subtree, from the motion's end on, and the price."""
    subtrees: dict[int, dict[str, Any]] = {}
    names = ("trials", "covered", "failed", "perturbed_states", "nodes")
    for round_, done in grown.rounds:
        entry = subtrees.setdefault(round_.frame, {"timestep": round_.frame, **dict.fromkeys(names, 0)})
        counts = (round_.count, done.covered, done.failed, len(done.nodes), sum(done.nodes))
        for name, count in zip(names, counts):
            entry[name] += count
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

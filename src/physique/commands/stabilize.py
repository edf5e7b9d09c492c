"""Feedback along a run's motion: `policy.npz`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from physique.errors import InputError
from physique.feedback.connect import make_trunk
from physique.feedback.growth import root
from physique.feedback.lqr import WeightsName
from physique.feedback.policy import Policy
from physique.feedback.tree import Tree, save_policy
from physique.provenance import versions
from physique.runs.folder import change_run, describe, warn_replaced
from physique.runs.run import POLICY, TREE, Run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.store import PathLike

_FEWEST = 3  # frames


def stabilize(folder: PathLike, weights: WeightsName = "default", *, overwrite: bool = False) -> Policy:
    """Put `policy.npz`, LQR along the motion, into a run's folder; the policy comes back.

    weights: "default", chosen by measured survival, or "paper", those of section 4.1. overwrite:
    replace a policy that is there, with its tree; the very same one stays without. Raises
    InputError for what is no finished run, and for another policy in the folder.
    """
    if weights not in get_args(WeightsName):
        raise InputError("weights", repr(weights), "default or paper", "choose one of the two")
    with change_run(folder) as run:
        require_motion(run)
        if not overwrite and _is_stabilized(run, weights):
            return run.policy()
        warn_policy_replaced(run)
        motion = run.trajectory
        with quiet(), MujocoSimulator(run.character(), 1) as simulator:
            trunk = make_trunk(simulator, motion.q, motion.v, motion.control, weights)
        write_policy(run, root(trunk), {"weights": weights})
        return run.policy()


def warn_policy_replaced(run: Run) -> None:
    """Name the policy that is about to be overwritten, where there is one."""
    assert run.folder is not None
    warn_replaced(run.folder, [name for name in (POLICY, TREE) if (run.folder / name).exists()])


def write_policy(run: Run, tree: Tree, facts: Mapping[str, Any]) -> None:
    """Write a policy of this tree, with facts about it, over what there may be."""
    assert run.folder is not None
    identity = run.record["identity"]
    about = {"clip": identity["clip"], "body": identity.get("body", run.body.name), "versions": versions()}
    (run.folder / TREE).unlink(missing_ok=True)
    save_policy(run.folder / POLICY, run.character_xml, tree, {**about, **facts})


def require_motion(run: Run) -> None:
    """Raise InputError where the motion is too short for feedback."""
    if run.trajectory.frames < _FEWEST:
        raise InputError(
            str(run.folder),
            f"a motion of {run.trajectory.frames} frames",
            f"at least {_FEWEST}",
            "retarget a longer part of the clip",
        )


def _is_stabilized(run: Run, weights: WeightsName) -> bool:
    """Whether the run has just this policy; false without one. Raises InputError for another."""
    stored = run.policy_file()
    if stored is None:
        return False
    assert run.folder is not None
    facts = stored.facts
    if "tree" in facts:
        found = f"a policy with a tree, {describe(run.folder, TREE)}"
    elif facts.get("weights") != weights:
        found = f"a policy of the weights {facts.get('weights')}"
    elif facts.get("versions") != versions():
        found = "a policy of other versions"
    else:
        return True
    raise InputError(
        str(run.folder / POLICY), found, "none, or the same", "keep it, or add --overwrite to replace it"
    )

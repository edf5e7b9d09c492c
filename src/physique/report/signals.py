"""What a report plots: signals of a run at the frames that it shows, ready for JSON."""

from __future__ import annotations

import base64
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.character import kinematics
from physique.character.hinges import HINGES
from physique.character.joint_error import joint_errors
from physique.character.soles import sole_points
from physique.report.difficulty import parts
from physique.report.words import hinge_words, joint_words
from physique.runs.run import Run
from physique.simulation.ground_reaction import ground_reaction

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s2
#: A foot is on the floor where a corner of it is at most this high. Soles are boxes around round
#: feet, and in a reference, which nothing holds up, they hover.
ON_FLOOR = 0.02  # m
#: Joint angles whose torques are shown as one line, left and right together.
GROUPS = ("hip", "knee", "ankle", "foot", "spine", "neck", "collar", "shoulder", "elbow", "wrist")
_GROUP_WORDS = {
    "hip": "hips",
    "knee": "knees",
    "ankle": "ankles",
    "foot": "toes",
    "spine": "back",
    "neck": "neck",
    "collar": "shoulder blades",
    "shoulder": "shoulders",
    "elbow": "elbows",
    "wrist": "wrists",
}
_FULL = 200  # stored value of a torque at its limit


def signals(run: Run, kept: NDArray[np.intp]) -> dict[str, Any]:
    """Signals at frames kept (K,), increasing.

    A torque belongs to the step that begins at its frame; the last frame repeats the last step.
    The shares of torque are bytes in base64, (K, 50), 200 for a torque at its limit.
    """
    motion = run.trajectory
    character = run.character()
    pose = kinematics.poses(character, motion.q)
    wanted = kinematics.joint_positions(character, motion.reference_q)
    errors = 1e3 * joint_errors(pose.joints, wanted)  # (T, 22) mm
    use = np.abs(motion.torque) / character.torque_limit  # (T - 1, 50)
    forces = ground_reaction(character, motion.q, motion.v, motion.control)
    weight = character.mass * GRAVITY
    on_floor = np.stack(
        [sole_points(character, q)[..., 2].min(axis=2) <= ON_FLOOR for q in (motion.q, motion.reference_q)]
    )  # (2, T, 2)
    steps = np.minimum(kept, max(len(motion.torque) - 1, 0))
    shown = np.clip(np.rint(use * _FULL), 0, 255).astype(np.uint8)[steps]
    return {
        "times": _short(motion.times[kept], 3),
        "error": _short(errors.mean(axis=1)[kept], 1),
        "worst": _short(errors.max(axis=1)[kept], 0),
        "worstJoint": errors.argmax(axis=1)[kept].tolist(),
        "height": _short(motion.q[kept, 2], 3),
        "heightSource": _short(motion.source_q[kept, 2], 3),
        "use": base64.b64encode(shown.tobytes()).decode(),
        "force": [_short(f[steps] / weight, 2) for f in forces.feet[..., 2].T],
        "forceOther": _short(forces.other[steps, 2] / weight, 2),
        "onFloorSource": [side[kept].astype(int).tolist() for side in on_floor[1].T],
        "windows": [dataclasses.asdict(part) for part in parts(run, use, errors, on_floor)],
        "limits": _short(character.torque_limit, 1),
    }


def names() -> dict[str, Any]:
    """What the numbers of `signals` stand for, the same for all runs."""
    stems = [h.joint.removeprefix("left_").removeprefix("right_").rstrip("123") for h in HINGES]
    return {
        "joints": [joint_words(joint) for joint in skeleton.JOINTS],
        "hinges": [hinge_words(hinge.name) for hinge in HINGES],
        "hingeJoint": [skeleton.JOINTS[hinge.index] for hinge in HINGES],
        "groups": [
            {"name": _GROUP_WORDS[group], "hinges": [i for i, s in enumerate(stems) if s == group]}
            for group in GROUPS
        ],
        "full": _FULL,
    }


def _short(values: Array, digits: int) -> list[float]:
    rounded = np.round(values, digits) + 0.0
    return rounded.astype(int).tolist() if digits == 0 else rounded.tolist()

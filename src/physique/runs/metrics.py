"""How well the body performed the motion, in numbers. docs/metrics.md defines each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.character import kinematics
from physique.character.hinges import HINGES
from physique.character.joint_error import SUCCESS_LIMIT, joint_errors
from physique.character.kinematics import Poses
from physique.character.model import CONTACT_FADE, Character
from physique.character.soles import sole_points
from physique.reference.reference import Reference
from physique.reference.target import Target, Weights
from physique.tracking import costs
from physique.tracking.trajectory import Trajectory
from physique.tracking.windows import Window

Array = NDArray[np.float64]

#: A torque counts as saturated from this part of its limit on.
SATURATED = 0.999


def measure(
    character: Character,
    reference: Reference,
    trajectory: Trajectory,
    windows: Sequence[Window],
    weights: Weights,
) -> dict[str, Any]:
    """All metrics that follow from the motion itself, ready for JSON.

    Success needs every frame of the reference: a simulation that blew up is cut short.
    """
    frames, step = trajectory.frames, reference.timestep
    planted = reference.contacts[:frames]
    pose = kinematics.poses(character, trajectory.q)
    shift = trajectory.reference_q[:, :3] - reference.q[:frames, :3]
    wanted = reference.joints[:frames] + shift[:, None]
    error = joint_errors(pose.joints, wanted)  # (T, 22)
    by_frame = error.mean(axis=1)
    worst = int(by_frame.argmax())
    local = joint_errors(pose.joints - pose.joints[:, :1], wanted - wanted[:, :1])
    root = error[:, 0]
    sunk = penetration(pose.lowest)
    terms = motion_cost(pose, reference, trajectory, weights)
    still = joint_errors(pose.joints, reference.joints[:frames])
    return {
        "success": bool(frames == reference.frames and by_frame.max() <= SUCCESS_LIMIT),
        "frames": frames,
        "seconds": float(trajectory.times[-1]),
        "reference_seconds": (reference.frames - 1) * step,
        "mpjpe_mm": 1e3 * float(by_frame.mean()),
        "mpjpe_max_mm": 1e3 * float(by_frame.max()),
        "mpjpe_local_mm": 1e3 * float(local.mean()),
        "mpjpe_unanchored_mm": 1e3 * float(still.mean()),
        "worst_frame": {
            "frame": worst,
            "time": float(trajectory.times[worst]),
            "joint": skeleton.JOINTS[int(error[worst].argmax())],
            "joint_error_mm": 1e3 * float(error[worst].max()),
        },
        "root_error_mm": 1e3 * float(root.mean()),
        "root_error_max_mm": 1e3 * float(root.max()),
        "drift_mm": 1e3 * float(np.linalg.norm(shift - shift[0], axis=1).max()),
        "foot_skate_mm_per_s": foot_skate(character, trajectory.q, step),
        "foot_skate_reference_mm_per_s": foot_skate(character, reference.q[:frames], step),
        "foot_skate_planted_mm_per_s": foot_skate(character, trajectory.q, step, planted),
        "foot_skate_planted_reference_mm_per_s": foot_skate(character, reference.q[:frames], step, planted),
        "foot_skate_source_mm_per_s": foot_skate(
            character, reference.source_q[:frames], step, planted, own_floor=True
        ),
        "penetration_mm": 1e3 * float(sunk.mean()),
        "penetration_max_mm": 1e3 * float(sunk.max()),
        "cost": _summed(terms),
        "cost_paper": _summed(motion_cost(pose, reference, trajectory, Weights())),
        **torque_use(character, trajectory.torque),
        "windows": [window_metrics(w, by_frame, step) for w in windows],
    }


def penetration(lowest: Array) -> Array:
    """How far (T,), m, the deepest shape is under z = 0; lowest (T, ngeom) m as in `Poses`."""
    return np.maximum(0.0, -lowest.min(axis=1))


def foot_skate(
    character: Character,
    q: Array,
    timestep: float,
    planted: NDArray[np.bool_] | None = None,
    own_floor: bool = False,
) -> float:
    """Horizontal speed, mm/s, of what touches the floor in q (T, 57), over the time it does.

    Corners of a foot touch where contact acts, at both ends of a step; the foot's speed is their
    mean. planted: (T, 2), counts only these frames of the left and the right foot. own_floor: each
    foot has its floor under its lowest corner, in each frame; for recordings, where feet hover and
    sink. 0 where nothing ever touches.
    """
    points = sole_points(character, q)  # (T, 2, 16, 3)
    height = points[..., 2]
    if own_floor:
        height = height - height.min(axis=-1, keepdims=True)
    low = height <= CONTACT_FADE
    if planted is not None:
        low &= planted[..., None]
    touching = low[:-1] & low[1:]  # (T - 1, 2, 16)
    speed = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1) / timestep
    count = touching.sum(axis=-1)
    in_contact = count > 0
    if not in_contact.any():
        return 0.0
    of_feet = (speed * touching).sum(axis=-1)[in_contact] / count[in_contact]
    return 1e3 * float(of_feet.mean())


def motion_cost(
    pose: Poses, reference: Reference, trajectory: Trajectory, weights: Weights
) -> dict[str, Array]:
    """Weighted terms of Eq. 2 over all frames, against the reference as moved for each window.

    pose: of the trajectory.
    """
    frames = trajectory.frames
    shift = trajectory.reference_q[:, :3] - reference.q[:frames, :3]
    target = Target(
        q=trajectory.reference_q,
        v=reference.v[:frames],
        com=reference.com[:frames] + shift,
        com_velocity=reference.com_velocity[:frames],
    )
    com_velocity = kinematics.com_velocity(pose.com_jacobian, trajectory.v)
    return costs.evaluate(
        weights, target, trajectory.q, trajectory.v, pose.com, com_velocity, reference.timestep
    )


def _summed(terms: dict[str, Array]) -> dict[str, float]:
    return {"total": float(costs.total(terms)), **{name: float(value) for name, value in terms.items()}}


def torque_use(character: Character, torque: Array) -> dict[str, Any]:
    """How near torques (N, 50), Nm, come to the limits: the share at them, of all and by joint."""
    if len(torque) == 0:
        return {"torque_saturation": 0.0, "torque_saturation_by_joint": {}, "torque_peak_nm": 0.0}
    full = np.abs(torque) >= SATURATED * character.torque_limit
    by_joint = {h.name: float(x) for h, x in zip(HINGES, full.mean(axis=0)) if x > 0}
    return {
        "torque_saturation": float(full.mean()),
        "torque_saturation_by_joint": by_joint,
        "torque_peak_nm": float(np.abs(torque).max()),
    }


def window_metrics(window: Window, by_frame: Array, timestep: float) -> dict[str, Any]:
    """Of one window: E of its whole horizon by term, and the errors, (T,) m, of what was kept.

    `difficulty` is E per second of horizon, so that windows of different lengths compare.
    """
    kept = by_frame[window.start + 1 : window.stop + 1]
    seconds = (window.stop - window.start + len(window.tail_control)) * timestep
    return {
        "start": window.start * timestep,
        "end": window.stop * timestep,
        "horizon_end": window.start * timestep + seconds,
        "cost": window.cost,
        "cost_terms": window.terms,
        "difficulty": window.cost / seconds,
        "success": bool(kept.max() <= SUCCESS_LIMIT),
        "mpjpe_mm": 1e3 * float(kept.mean()),
        "mpjpe_max_mm": 1e3 * float(kept.max()),
        "iterations": window.iterations,
        "sim_steps": window.sim_steps,
        "status": window.status,
    }

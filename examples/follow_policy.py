"""Drive a character by its policy, in plain MuJoCo: needs NumPy and MuJoCo only.

    physique retarget punch --body average --out out/punch
    physique stabilize out/punch
    python examples/follow_policy.py out/punch/policy.npz

Writes how far the body is from the motion, with a shove of 15 Ns against the chest.
"""

import sys

import mujoco
import numpy as np

from physique.feedback.policy import load_policy
from physique.simulation.closed_loop import motor_model


def follow(path: str, control: str = "targets", shove: float = 150.0) -> float:
    """Greatest distance, m, of the pelvis from the motion's, pushed with `shove` N for 0.1 s."""
    policy = load_policy(path, control=control)
    # Position targets are for the servos of the character's own model, torques for motors.
    if control == "targets":
        model = mujoco.MjModel.from_xml_string(policy.model_xml)
    else:
        model = motor_model(policy.model_xml)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = policy.initial_state
    policy.reset()
    worst = 0.0
    while policy.time < policy.seconds:
        pushed = 0.2 <= policy.time < 0.3
        data.xfrc_applied[model.body("spine3").id, 0] = -shove if pushed else 0.0
        worst = max(worst, float(np.linalg.norm(data.qpos[:3] - policy.tree.q[policy.frame, :3])))
        data.ctrl[:] = policy.act(data.qpos, data.qvel)
        mujoco.mj_step(model, data)
    return worst


if __name__ == "__main__":
    for kind in ("targets", "torques"):
        sys.stdout.write(f"{kind}: {follow(sys.argv[1], kind):.3f} m\n")

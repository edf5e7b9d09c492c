"""What a character's text alone must do."""

from __future__ import annotations

import mujoco
import numpy as np

from physique.character.model import Character
from physique.character.servo import within_limits
from physique.reference.reference import Reference
from physique.simulation.rollout import simulate
from physique.simulation.stepper import Stepper


def assert_text_replays(character: Character, walk: Reference, steps: int) -> None:
    """Plain MuJoCo, given the model's text and the control, gives every frame of a simulation again."""
    r, _ = simulate(
        Stepper(character.model),
        walk.q[20],
        walk.v[20],
        steps,
        lambda t, q, v: within_limits(character, walk.q[21 + t, 7:], q, v),
    )
    model = mujoco.MjModel.from_xml_string(character.xml)
    fresh = mujoco.MjData(model)
    fresh.qpos[:], fresh.qvel[:] = walk.q[20], walk.v[20]
    for t in range(steps):
        fresh.ctrl[:] = r.control[t]
        mujoco.mj_step(model, fresh)
        assert np.array_equal(fresh.qpos, r.q[t + 1]), f"step {t}"

"""A short run of real physics, without the minutes that finding a good one takes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.run import Run
from physique.simulation.character import make_character
from physique.simulation.rollout import simulate, within_limits
from physique.simulation.start import start_state
from physique.tracking.reference import Reference
from physique.tracking.trajectory import Trajectory

Array = NDArray[np.float64]

FRAMES = 41


@pytest.fixture(scope="session")
def run(walk: Reference) -> Run:
    """The average body for 0.4 s of the walk, led by the reference's angles alone."""
    mesh = named_body("average")
    body = capsule_body(mesh)
    character = make_character(body, 150.0)
    q0, v0 = start_state(character, walk.q[0], walk.v[0], walk.contacts[0])

    def follow(t: int, q: Array, v: Array) -> Array:
        return within_limits(character, walk.q[t + 1, 7:], q, v)

    made = simulate(character, mujoco.MjData(character.model), q0, v0, FRAMES - 1, follow)
    assert not made.diverged
    motion = Trajectory(
        np.arange(FRAMES) * 0.01, made.q, made.v, made.control, made.torque, walk.q[:FRAMES]
    )
    record = {"identity": {"clip": "walk", "body": "average"}}
    return Run(record, {"success": True}, motion, character.xml, body, mesh)

"""The average body as a character, and states of real motion on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from physique.simulation.character import Character
from physique.simulation.rollout import within_limits
from physique.tracking.reference import Reference

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moment:
    """A state q (57,), v (56,) and a control u (50,)."""

    q: Array
    v: Array
    u: Array


@pytest.fixture(scope="session")
def moments(character: Character, walk: Reference) -> list[Moment]:
    """Walking states with feet on the floor, a few simulated steps after the reference's."""
    model = character.model
    data = mujoco.MjData(model)
    out = []
    for t in (22, 45, 130, 190):
        data.qpos[:], data.qvel[:] = walk.q[t], walk.v[t]
        for _ in range(3):
            data.ctrl[:] = within_limits(character, walk.q[t + 1, 7:], data.qpos, data.qvel)
            mujoco.mj_step(model, data)
        q, v = data.qpos.copy(), data.qvel.copy()
        out.append(Moment(q, v, within_limits(character, walk.q[t + 1, 7:], q, v)))
    return out


@pytest.fixture(scope="session")
def step(character: Character) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """One `mj_step` of plain MuJoCo."""
    data = mujoco.MjData(character.model)

    def run(q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        mujoco.mj_resetData(character.model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
        mujoco.mj_step(character.model, data)
        return data.qpos.copy(), data.qvel.copy()

    return run

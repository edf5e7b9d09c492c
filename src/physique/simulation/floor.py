"""What the floor does to the body in a step: forces and their centres of pressure."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Below this force a foot counts as in the air: it has no centre of pressure.
LEAST_FORCE = 1.0  # N


class FloorForces(NamedTuple):
    """Of one step. feet: (2, 3) N, world, from the floor on the left and the right foot. pressure: (2, 2) m,
    x and y of each foot's centre of pressure on the floor; NaN in the air. other: (3,) N, on all other
    parts: hands, knees, a body that has fallen."""

    feet: Array
    pressure: Array
    other: Array


class FloorContacts:
    """Reads what the floor does to a character from MuJoCo's contacts."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._foot_of = np.full(model.ngeom, -1)
        for side, name in enumerate(("left", "right")):
            for part in ("ankle", "foot"):
                self._foot_of[model.geom(f"{name}_{part}").id] = side
        self._floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE

    def read(self, data: mujoco.MjData) -> FloorForces:
        """Of the step that `data` took last."""
        feet, other = np.zeros((2, 3)), np.zeros(3)
        moment = np.zeros((2, 2))  # of each foot's force about the origin: -M_y, M_x
        wrench = np.empty(6)
        for index in range(data.ncon):
            contact = data.contact[index]
            first, second = int(contact.geom1), int(contact.geom2)
            if self._floor[first] == self._floor[second]:
                continue
            mujoco.mj_contactForce(self._model, data, index, wrench)
            # The rows of `frame` are the contact's axes; the force is that on the second geom.
            force = contact.frame.reshape(3, 3).T @ wrench[:3]
            if self._floor[second]:
                force = -force
            foot = self._foot_of[first if self._floor[second] else second]
            if foot < 0:
                other += force
                continue
            feet[foot] += force
            moment[foot] += contact.pos[:2] * force[2] - contact.pos[2] * force[:2]
        up = feet[:, 2:]
        pressure = np.where(up > LEAST_FORCE, moment / np.maximum(up, LEAST_FORCE), np.nan)
        return FloorForces(feet, pressure, other)

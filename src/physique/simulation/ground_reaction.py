"""What the floor does to the body: forces and their centres of pressure, by replay."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character

Array = NDArray[np.float64]

#: Below this force a foot counts as in the air: it has no centre of pressure.
LEAST_FORCE = 1.0  # N


@dataclass(frozen=True)
class GroundReaction:
    """Of N steps, between frame t and frame t + 1.

    feet: (N, 2, 3) N, world, from the floor on the left and the right foot.
    pressure: (N, 2, 2) m, x and y of each foot's centre of pressure on the floor; NaN in the air.
    other: (N, 3) N, on all other parts: hands, knees, a body that has fallen.
    """

    feet: Array
    pressure: Array
    other: Array

    @property
    def total(self) -> Array:
        """(N, 3) N: all that the floor does."""
        return self.feet.sum(axis=1) + self.other


class FloorContacts:
    """Reads what the floor does to a character from MuJoCo's contacts."""

    def __init__(self, character: Character) -> None:
        self._model = character.model
        self._foot_of = np.full(character.model.ngeom, -1)
        for side in (0, 1):
            self._foot_of[character.foot_geoms[side]] = side
        self._floor = character.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE

    def read(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Forces on the feet (2, 3) N, their centres of pressure (2, 2) m, and the force on all
        other parts (3,) N, of the step that `data` took last; as in `GroundReaction`."""
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
        return feet, pressure, other


def ground_reaction(character: Character, q: Array, v: Array, control: Array) -> GroundReaction:
    """Repeat each step from q (N + 1, 57), v (N + 1, 56) under control (N, 50) and read contacts.

    Every step starts from the states given, which are all that a step depends on, so the forces
    are those of the run itself.
    """
    data = mujoco.MjData(character.model)
    contacts = FloorContacts(character)
    steps = len(control)
    out = GroundReaction(np.empty((steps, 2, 3)), np.empty((steps, 2, 2)), np.empty((steps, 3)))
    for t in range(steps):
        data.qpos[:], data.qvel[:], data.ctrl[:] = q[t], v[t], control[t]
        mujoco.mj_step(character.model, data)
        out.feet[t], out.pressure[t], out.other[t] = contacts.read(data)
    return out

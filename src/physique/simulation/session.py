"""One simulation that goes on step by step and can be pushed."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character
from physique.simulation.floor import FloorForces
from physique.simulation.stepper import Push, Stepper

Array = NDArray[np.float64]

PUSH_SECONDS = 0.1
#: A ray that passes the body at this distance still counts as a hit: the skin that people aim at
#: stands off the shapes that are simulated.
NEAR_MISS = 0.12  # m


@dataclass(frozen=True)
class Hit:
    """Where a ray meets the body: the part, and the point (3,), m, in the part's frame."""

    part: int
    point: Array


class Session:
    """A character in a state (q, v), which targets, gravity, the floor and pushes move on.

    Without pushes it steps exactly as `rollout.simulate` does, to the same bits.
    """

    def __init__(self, character: Character, q: Array, v: Array) -> None:
        self.character = character
        self._stepper = Stepper(character.model)
        self.restart(q, v)

    def restart(self, q: Array, v: Array) -> None:
        """Go on from q (57,), v (56,); pushes that were under way end."""
        self._stepper.start(q, v)

    @property
    def steps(self) -> int:
        """Taken since the (re)start."""
        return self._stepper.steps

    @property
    def diverged(self) -> bool:
        """Whether the simulation blew up; then nothing happens any more."""
        return self._stepper.diverged

    @property
    def timestep(self) -> float:
        """Seconds of a step."""
        return float(self.character.model.opt.timestep)

    @property
    def q(self) -> Array:
        """(57,) of the state."""
        return self._stepper.q.copy()

    @property
    def v(self) -> Array:
        """(56,) of the state."""
        return self._stepper.v.copy()

    @property
    def torque(self) -> Array:
        """(50,) Nm that the targets exerted in the last step."""
        return self._stepper.torque.copy()

    @property
    def floor_forces(self) -> FloorForces:
        """Of the last step."""
        return self._stepper.floor

    @property
    def poses(self) -> Array:
        """World position (m) and orientation (wxyz) of the 22 joints: (22, 7)."""
        data, bodies = self._stepper.pose(), self.character.joint_bodies
        return np.concatenate([data.xpos[bodies], data.xquat[bodies]], axis=1)

    def push(self, hit: Hit, impulse: Array, seconds: float = PUSH_SECONDS) -> None:
        """Push the point that was hit from the next step on: impulse (3,) Ns, world. Pushes add up."""
        steps = max(1, round(seconds / self.timestep))
        force = tuple(impulse / (steps * self.timestep))
        self._stepper.push(Push(hit.part, force, self.steps, steps, tuple(hit.point)))

    def step(self, targets: Array) -> None:
        """One step under position targets (50,); nothing happens any more once it `diverged`."""
        self._stepper.step(targets)

    def cast(self, origin: Array, direction: Array) -> Hit | None:
        """What a ray from origin (3,), m, along direction (3,) hits, or only just misses."""
        data, model = self._stepper.pose(), self.character.model
        direction = direction / np.linalg.norm(direction)
        geom = np.array([-1], dtype=np.int32)
        distance = mujoco.mj_ray(model, data, origin, direction, None, False, -1, geom)
        index = int(geom[0])
        if index < 0:
            index, distance, miss = self._nearest(data, origin, direction)
            if miss > NEAR_MISS:
                return None
        body = int(model.geom_bodyid[index])
        part = int(np.flatnonzero(self.character.joint_bodies == body)[0])
        R_world_from_part = data.xmat[body].reshape(3, 3)
        point = origin + distance * direction
        return Hit(part, (point - data.xpos[body]) @ R_world_from_part)

    def world_point(self, part: int, point: Array) -> Array:
        """World position (3,), m, of a point (3,) in the frame of a part."""
        data, body = self._stepper.pose(), int(self.character.joint_bodies[part])
        return np.array(data.xpos[body] + data.xmat[body].reshape(3, 3) @ point)

    def _nearest(self, data: mujoco.MjData, origin: Array, direction: Array) -> tuple[int, float, float]:
        """The visible geom that the ray passes nearest to, how far along it, and the distance.

        Capsules are followed along their axes; other shapes count as the balls around them.
        """
        model = self.character.model
        geoms = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_rgba[:, 3] > 0))
        capsule = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE
        half = np.where(capsule, model.geom_size[geoms, 1], 0.0)
        radius = np.where(capsule, model.geom_size[geoms, 0], model.geom_rbound[geoms])
        axis = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2]
        away = data.geom_xpos[geoms] - origin
        # The point of each axis nearest to the ray's line, kept inside the capsule.
        slope = axis @ direction
        shift = (slope * (away @ direction) - np.sum(axis * away, axis=1)) / np.maximum(1.0 - slope**2, 1e-9)
        away = away + np.clip(shift, -half, half)[:, None] * axis
        along = np.maximum(away @ direction, 0.0)
        miss = np.linalg.norm(away - along[:, None] * direction, axis=1) - radius
        best = int(np.argmin(miss))
        return int(geoms[best]), float(along[best]), float(miss[best])

"""The held objects of a model, for whoever draws them or has to reckon with them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.body.capsule_body import Shape
from physique.body.held import PREFIX

Array = NDArray[np.float64]

_SHAPES: dict[int, Shape] = {
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}


@dataclass(frozen=True)
class HeldGeom:
    """One held object, rigid on a joint of `skeleton.JOINTS`.

    geom: its index in the model. shape, size (3,) m: as those of `capsule_body.Part`.
    joint: index of the joint whose frame it moves with. center (3,) m and R_joint_from_geom (3, 3):
        its pose in that frame, which in the T-pose is aligned with the world.
    rgb: (3,), 0 to 1.
    """

    name: str
    geom: int
    shape: Shape
    size: Array
    joint: int
    center: Array
    R_joint_from_geom: Array
    rgb: Array


def held_geoms(model: mujoco.MjModel) -> tuple[HeldGeom, ...]:
    """The objects that a character's model holds, none for empty hands."""
    found = []
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if not name.startswith(PREFIX):
            continue
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, model.geom_quat[geom])
        found.append(
            HeldGeom(
                name=name,
                geom=geom,
                shape=_SHAPES[int(model.geom_type[geom])],
                size=model.geom_size[geom].copy(),
                joint=skeleton.INDEX[model.body(model.geom_bodyid[geom]).name],
                center=model.geom_pos[geom].copy(),
                R_joint_from_geom=R.reshape(3, 3),
                rgb=model.geom_rgba[geom, :3].astype(float),
            )
        )
    return tuple(found)

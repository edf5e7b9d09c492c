"""What derivatives and simulation take for granted about a character's model."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from physique import skeleton
from physique.character.hinges import HINGES
from physique.errors import InputError

TIMESTEP = 0.01  # s

_SHAPES = (
    mujoco.mjtGeom.mjGEOM_PLANE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
)
_SENSORS = [int(mujoco.mjtSensor.mjSENS_SUBTREECOM), int(mujoco.mjtSensor.mjSENS_SUBTREELINVEL)]


def check(model: mujoco.MjModel) -> None:
    """Raise InputError that names the first thing in which the model is no character's."""
    joints = [model.joint(i).name for i in range(model.njnt)]
    if joints[1:] != [h.name for h in HINGES] or model.nu != len(HINGES):
        raise _refusal(
            f"{model.nu} actuators, {model.njnt} joints",
            f"the {len(HINGES)} hinges of a character and one free joint",
        )
    for what, holds in _premises(model).items():
        if not np.all(holds):
            raise _refusal(f"other {what}", "a model as physique writes it")


def _premises(model: mujoco.MjModel) -> dict[str, Any]:
    """What must hold, by what it is about."""
    option, gain, bias = model.opt, model.actuator_gainprm, model.actuator_biasprm
    hinges = np.arange(1, model.njnt)
    return {
        "time step": option.timestep == TIMESTEP,
        "integrator": option.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE,
        "friction cone": option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC,
        # Warm starts would make the state more than (q, v).
        "flags": option.disableflags == mujoco.mjtDisableBit.mjDSBL_WARMSTART and option.enableflags == 0,
        "gravity": option.gravity == (0.0, 0.0, -9.81),
        "medium than vacuum": option.density == option.viscosity == 0,
        "bodies": sorted(model.body(i).name for i in range(1, model.nbody)) == sorted(skeleton.JOINTS),
        "joint types": model.jnt_type
        == np.where(np.arange(model.njnt) == 0, mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_HINGE),
        "joint limits": ~model.jnt_limited.astype(bool),
        "passive forces": not (
            model.jnt_stiffness.any()
            or model.dof_damping.any()
            or model.dof_frictionloss.any()
            or model.body_gravcomp.any()
        ),
        "constraints": model.neq == model.ntendon == model.nmocap == model.npair == model.nflex == 0,
        "contact dimensions": model.geom_condim == 3,
        "shapes": np.isin(model.geom_type, [int(shape) for shape in _SHAPES]),
        "feet": {f"{side}_{part}" for side in ("left", "right") for part in ("ankle", "foot")}
        <= {model.geom(i).name for i in range(model.ngeom)},
        "floor": model.geom_type[0] == mujoco.mjtGeom.mjGEOM_PLANE
        and np.count_nonzero(model.geom_bodyid == 0) == 1
        and not model.geom_pos[0].any(),
        "actuators": (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)
        & (model.actuator_trnid[:, 0] == hinges)
        & (model.actuator_gear[:, 0] == 1)
        & (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE)
        & ~model.actuator_ctrllimited.astype(bool),
        "servos than PD controllers": (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED)
        & (model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE)
        & (gain[:, 0] > 0)
        & (bias[:, 0] == 0)
        & (bias[:, 1] == -gain[:, 0])
        & (bias[:, 2] <= 0),
        "torque limits": model.actuator_forcelimited.astype(bool)
        & (model.actuator_forcerange[:, 1] > 0)
        & (model.actuator_forcerange[:, 0] == -model.actuator_forcerange[:, 1]),
        "sensors": model.sensor_type[:2].tolist() == _SENSORS,
    }


def _refusal(found: str, expected: str) -> InputError:
    return InputError("character model", found, expected, "make the run anew")

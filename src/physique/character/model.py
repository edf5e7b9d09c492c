"""CapsuleBody -> a MuJoCo model: 57 coordinates, 56 velocities, 50 position-controlled hinges.

Every actuator is the paper's PD controller (Eq. 1): torque = kp (target - angle) - kd velocity,
limited. `integrator="discrete"` treats its stiffness implicitly; explicit integrators diverge at
kp 700 and 0.01 s. Warm starts are off, so that (q, v) alone is the whole state: any frame can be
replayed bit for bit.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.body.capsule_body import CapsuleBody, Part
from physique.body.held import Held, held_parts
from physique.character import premises
from physique.character.held import held_geoms
from physique.character.hinges import AXES, HINGES
from physique.errors import InputError

Array = NDArray[np.float64]

STIFFNESS = 700.0  # kp, Nm/rad (section 3)
DAMPING = 1.0  # kd, Nm s/rad (section 3)
ARMATURE = 0.01  # kg m2
FRICTION = 1.0
#: Contacts fade in over this distance above the surface. Hard onset makes the cost jump where a
#: foot touches down and derivatives useless.
CONTACT_FADE = 0.005  # m

_GEOM_TYPE = {
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}


@dataclass(frozen=True)
class Character:
    """A body that can be simulated.

    xml: MJCF text; `model` is compiled from this very text, so that whoever loads it steps the
        same numbers.
    torque_limit: (50,) Nm. stiffness, damping: (50,), kp, Nm/rad, and kd, Nm s/rad, of Eq. 1.
    joint_bodies: (22,) MuJoCo body index of each joint of `skeleton.JOINTS`.
    foot_geoms: (2, 2) geom index of (foot, toes) of the left and the right leg.
    """

    body: CapsuleBody
    xml: str
    model: mujoco.MjModel
    torque_limit: Array
    joint_bodies: NDArray[np.int64]
    foot_geoms: NDArray[np.int64]
    stiffness: Array
    damping: Array

    @property
    def mass(self) -> float:
        """Total mass, kg, with what the body holds."""
        return float(self.model.body_subtreemass[0])


def make_character(body: CapsuleBody, torque_limit: Array | float, held: Held | None = None) -> Character:
    """Build the model of `body` with limits of `torque_limit` (50,) or one for all, Nm.

    held: what the hands hold, welded to them: no coordinate more, its mass is the hand's.
    """
    limits = np.broadcast_to(np.asarray(torque_limit, dtype=float), (len(HINGES),)).copy()
    objects = held_parts(held, body) if held else {}
    return load_character(_spec(body, limits, objects).to_xml(), body)


def empty_handed(character: Character) -> Character:
    """The same body without what it holds; itself where it holds nothing."""
    if not held_geoms(character.model):
        return character
    return make_character(character.body, character.torque_limit)


def load_character(xml: str, body: CapsuleBody) -> Character:
    """The character of a model that `make_character` wrote for this body.

    Raises InputError for a text that is no such model, or one that differs in what simulation and
    derivatives take for granted.
    """
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except ValueError as fault:
        raise InputError(
            "character model", str(fault).splitlines()[0], "MJCF of a character", "make the run anew"
        ) from None
    premises.check(model)
    geom = {model.geom(i).name: i for i in range(model.ngeom)}
    return Character(
        body=body,
        xml=xml,
        model=model,
        # What the model has: its text keeps six digits.
        torque_limit=model.actuator_forcerange[:, 1].copy(),
        joint_bodies=np.array([model.body(name).id for name in skeleton.JOINTS]),
        stiffness=model.actuator_gainprm[:, 0].copy(),
        damping=-model.actuator_biasprm[:, 2],
        foot_geoms=np.array([[geom[f"{s}_ankle"], geom[f"{s}_foot"]] for s in ("left", "right")]),
    )


def _spec(body: CapsuleBody, limits: Array, objects: dict[str, Part]) -> mujoco.MjSpec:
    """objects: by the joint of the hand that holds each."""
    spec = mujoco.MjSpec()
    spec.modelname = body.name
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    option = spec.option
    option.timestep = premises.TIMESTEP
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    # Elliptic cones are smoother than pyramids; the ratio keeps soft contacts from creeping
    # sideways; larger ratios cost the constraint solver several times more iterations.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 3.0
    # Sparse is three times faster here, dense gives the same numbers.
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # Sane steps take 2 to 10 iterations; only a body that explodes takes more.
    option.iterations = 40
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        rgba=[0.8, 0.8, 0.8, 1],
        **_contact(Touches.FLOOR),
    )
    bodies: dict[int, mujoco.MjsBody] = {-1: spec.worldbody}
    origin = np.zeros(3)
    for index, (name, part) in enumerate(zip(skeleton.JOINTS, body.parts)):
        parent = skeleton.PARENTS[index]
        parent_joint = origin if parent < 0 else body.joints[parent]
        node = bodies[parent].add_body(name=name, pos=body.joints[index] - parent_joint)
        bodies[index] = node
        if parent < 0:
            node.add_freejoint(name="root")
        for axis in AXES.get(name, ""):
            node.add_joint(
                name=f"{name}_{axis}",
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=np.eye(3)["xyz".index(axis)],
                armature=ARMATURE,
            )
        _add_part(node, part, body.joints[index])
        if name in objects:
            _add_object(node, objects[name], body.joints[index])
            part = _together(part, objects[name])
        _set_inertia(node, part, body.joints[index])
    for i, j in body.excluded:
        spec.add_exclude(bodyname1=skeleton.JOINTS[i], bodyname2=skeleton.JOINTS[j])
    for hinge, limit in zip(HINGES, limits):
        actuator = spec.add_actuator(name=hinge.name, target=hinge.name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        actuator.set_to_position(kp=STIFFNESS, kv=DAMPING)
        actuator.forcerange = [-limit, limit]
    for kind in (mujoco.mjtSensor.mjSENS_SUBTREECOM, mujoco.mjtSensor.mjSENS_SUBTREELINVEL):
        spec.add_sensor(
            name=kind.name.removeprefix("mjSENS_").lower(),
            type=kind,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            objname="pelvis",
        )
    spec.compile()
    return spec


class Touches(enum.Enum):
    """What a geom collides with, as MuJoCo's (contype, conaffinity)."""

    FLOOR = (1, 0)  # is the floor
    SOLE = (0, 1)  # only the floor
    LIMB = (2, 2)  # only other parts
    PART = (2, 3)  # both
    OBJECT = (0, 3)  # both, but no other object: the normal between two boxes jumps


def _contact(touches: Touches) -> dict[str, object]:
    return {
        "contype": touches.value[0],
        "conaffinity": touches.value[1],
        "condim": 3,
        "friction": [FRICTION, 0.005, 0.0001],
        "margin": CONTACT_FADE / 2,  # margins of the two geoms add up
        "solimp": [0.0, 0.95, CONTACT_FADE, 0.5, 2.0],
        "solref": [0.02, 1.0],
    }


def _add_part(node: mujoco.MjsBody, part: Part, joint: Array) -> None:
    """Shape of `part` on the body whose frame sits at `joint`, aligned at rest."""
    rgba = [0.72, 0.6, 0.52, 1.0]
    if part.name.startswith("left_"):
        rgba = [0.35, 0.55, 0.75, 1.0]
    elif part.name.startswith("right_"):
        rgba = [0.8, 0.45, 0.38, 1.0]
    box = part.shape == "box"
    node.add_geom(
        name=part.name,
        type=_GEOM_TYPE[part.shape],
        size=part.size,
        pos=part.center - joint,
        quat=_quaternion(part.R_world_from_part),
        rgba=rgba,
        **_contact(Touches.SOLE if box else Touches.PART),
    )
    if box:
        # The normal between two boxes jumps from face to face as they turn, and the cost with it.
        size, R = _capsule_in_box(part.size, part.R_world_from_part)
        node.add_geom(
            name=f"{part.name}_flesh",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=size,
            pos=part.center - joint,
            quat=_quaternion(R),
            rgba=[0.0, 0.0, 0.0, 0.0],
            **_contact(Touches.LIMB),
        )


def _add_object(node: mujoco.MjsBody, part: Part, joint: Array) -> None:
    """A held object. MuJoCo lets no body touch itself or its parent: neither hand nor forearm."""
    node.add_geom(
        name=part.name,
        type=_GEOM_TYPE[part.shape],
        size=part.size,
        pos=part.center - joint,
        quat=_quaternion(part.R_world_from_part),
        rgba=[0.42, 0.3, 0.18, 1.0],
        **_contact(Touches.OBJECT),
    )


def _together(part: Part, other: Part) -> Part:
    """`part` with the mass of both, welded: the parallel axis theorem."""
    mass = part.mass + other.mass
    com = (part.mass * part.com + other.mass * other.com) / mass
    total = np.zeros((3, 3))
    for p in (part, other):
        d = p.com - com
        total += p.inertia + p.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return replace(part, mass=mass, com=com, inertia=total)


def _set_inertia(node: mujoco.MjsBody, part: Part, joint: Array) -> None:
    node.explicitinertial = True
    node.mass = part.mass
    node.ipos = part.com - joint
    I = part.inertia  # noqa: E741
    node.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]


def _quaternion(R: Array) -> Array:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).ravel())
    return quat


def _capsule_in_box(half: Array, R: Array) -> tuple[Array, Array]:
    """Size (3,) and rotation (3, 3) of a capsule along the longest axis of a box, as thick as the
    other two are on (geometric) average."""
    longest = int(np.argmax(half))
    others = [(longest + 1) % 3, (longest + 2) % 3]
    radius = float(np.sqrt(half[others[0]] * half[others[1]]))
    size = np.array([radius, max(half[longest] - radius, 1e-3), 0.0])
    return size, np.stack([R[:, others[0]], R[:, others[1]], R[:, longest]], axis=1)

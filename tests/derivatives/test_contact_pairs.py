"""Contact derivatives of every pair of shapes that can meet, against central differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from physique.derivatives import contact, smooth

Array = NDArray[np.float64]
Geom = mujoco.mjtGeom

SHAPES = {
    "floor": (Geom.mjGEOM_PLANE, [0.0, 0.0, 0.05]),
    "capsule": (Geom.mjGEOM_CAPSULE, [0.05, 0.12, 0.0]),
    "box": (Geom.mjGEOM_BOX, [0.08, 0.05, 0.11]),
    "ellipsoid": (Geom.mjGEOM_ELLIPSOID, [0.09, 0.04, 0.02]),
}
#: How far the derivatives by position may be off, as a share of the largest one. MuJoCo finds contacts of
#: ellipsoids with other parts by iterations: small differences have their noise, large ones meet kinks.
PAIRS = {
    ("floor", "box"): 1e-5,
    ("floor", "capsule"): 1e-5,
    ("floor", "ellipsoid"): 1e-5,
    ("capsule", "capsule"): 1e-5,
    ("box", "capsule"): 1e-5,
    ("capsule", "ellipsoid"): 1e-2,
    ("ellipsoid", "ellipsoid"): 1e-2,
    ("box", "ellipsoid"): 3e-2,
}
STEPS = (1e-6, 1e-5, 1e-4)  # m and rad, of positions


def make_model(first: str, second: str) -> mujoco.MjModel:
    """The first shape on a free body, or the floor; the second at the end of an arm that hangs on it."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.integrator = 0.01, mujoco.mjtIntegrator.mjINT_DISCRETE
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 3.0
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
    option.ccd_tolerance, option.ccd_iterations = 1e-13, 2000
    touching = {
        "condim": 3,
        "friction": [1.0, 0.005, 0.0001],
        "margin": 0.0025,
        "solimp": [0.0, 0.95, 0.005, 0.5, 2.0],
        "solref": [0.02, 1.0],
    }
    ghost = {"type": Geom.mjGEOM_SPHERE, "size": [0.04, 0.0, 0.0], "contype": 0, "conaffinity": 0}
    root = spec.worldbody.add_body()
    root.add_freejoint()
    kind, size = SHAPES[first]
    if first == "floor":
        spec.worldbody.add_geom(type=kind, size=size, **touching)
        root.add_geom(mass=3.0, **ghost)
    else:
        root.add_geom(type=kind, size=size, mass=3.0, **touching)
    node = root
    for place in ([0.0, 0.0, 0.3], [0.2, 0.0, 0.0]):
        node = node.add_body(pos=place)
        for axis in np.eye(3):
            node.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=0.01)
        if place[0] == 0.0:
            node.add_geom(mass=1.0, **ghost)
    kind, size = SHAPES[second]
    node.add_geom(type=kind, size=size, mass=1.0, **touching)
    return spec.compile()


def touching_state(model: mujoco.MjModel, rng: np.random.Generator) -> Array:
    """A random pose in which the shapes touch, none deeper than 4 mm."""
    data = mujoco.MjData(model)
    for _ in range(20_000):
        turn = rng.normal(size=4)
        data.qpos[:3], data.qpos[3:7] = [0.0, 0.0, rng.uniform(0.1, 0.6)], turn / np.linalg.norm(turn)
        data.qpos[7:] = rng.uniform(-2.5, 2.5, size=model.nq - 7)
        mujoco.mj_forward(model, data)
        if data.ncon and all(-0.004 < c.dist < 0.0015 for c in data.contact):
            return data.qpos.copy()
    raise AssertionError("no pose in which they touch")


def differences(model: mujoco.MjModel, q: Array, v: Array, a: Array, step: float) -> list[Array]:
    """d inverse dynamics by q, v and a, each (nv, nv)."""
    data, nv = mujoco.MjData(model), model.nv

    def torque(dq: Array, dv: Array, da: Array) -> Array:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v + dv, a + da
        mujoco.mj_integratePos(model, data.qpos, dq, 1.0)
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse.copy()

    nothing = np.zeros((nv, nv))
    out = []
    for kind, size in enumerate((step, 1e-6, 1e-6)):
        moves = [nothing, nothing, nothing]
        moves[kind] = size * np.eye(nv)
        ends = [[torque(*(sign * m[k] for m in moves)) for k in range(nv)] for sign in (1.0, -1.0)]
        out.append((np.array(ends[0]) - np.array(ends[1])).T / (2 * size))
    return out


@pytest.mark.parametrize(("first", "second"), PAIRS, ids=" and ".join)
def test_derivatives_are_the_differences(first: str, second: str) -> None:
    model = make_model(first, second)
    rng = np.random.default_rng(1)
    tree, nv = smooth.make_tree(model), model.nv
    for _ in range(5):
        q, v = touching_state(model, rng), rng.normal(size=nv)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        a, axes = data.qacc.copy(), data.cdof[None].copy()
        found = contact.join(model, [contact.read(model, data)])
        ours = np.empty((3, 1, nv, nv))
        smooth.derivatives(*ours, tree, model.opt.gravity, axes, data.cinert[None, 1:], v[None], a[None])
        contact.subtract_derivatives(*ours, tree, axes, v[None], a[None], found)
        ours[2, 0] += np.diag(model.dof_armature)
        off = np.array([errors(ours[:, 0], differences(model, q, v, a, step)) for step in STEPS])
        assert off[:, 0].min() < PAIRS[first, second]
        assert off[0, 1] < 1e-5
        assert off[0, 2] < 1e-6


def errors(mine: Array, other: list[Array]) -> list[float]:
    """The greatest of each, as a share of the largest derivative."""
    return [float(np.abs(x - y).max() / np.abs(y).max()) for x, y in zip(mine, other)]

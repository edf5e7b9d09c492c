"""The model is the body: coordinates, masses, limits, friction; its text is all there is to it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from physique import skeleton
from physique.character.hinges import AXES, HINGES, columns
from physique.character.kinematics import joint_positions
from physique.character.model import Character, make_character
from physique.character.state import integrate
from physique.motion.read import read_motion
from physique.reference.reference import Reference, make_reference
from replay import assert_text_replays

#: MJCF text holds six significant digits, so lengths are off by micrometres.
DIGITS = 6e-6


def test_dimensions_are_the_papers(character: Character) -> None:
    model = character.model
    assert (model.nq, model.nv, model.nu) == (57, 56, 50)
    assert [model.actuator(i).name for i in range(50)] == [h.name for h in HINGES]
    assert [model.joint(1 + i).name for i in range(50)] == [h.name for h in HINGES]
    assert model.opt.timestep == 0.01
    assert np.all(model.actuator_gainprm[:, 0] == 700.0)
    assert np.all(model.actuator_biasprm[:, 2] == -1.0)
    assert np.all(model.actuator_forcerange == [-100.0, 100.0])
    assert np.all(model.geom_friction[:, 0] == 1.0)


def test_each_limit_reaches_its_own_joint(character: Character) -> None:
    limits = np.linspace(20, 300, 50)
    model = make_character(character.body, limits).model
    for hinge, limit in zip(HINGES, limits):
        assert model.actuator(hinge.name).forcerange == pytest.approx([-limit, limit], rel=DIGITS)


def test_masses_and_inertias_are_the_bodys(character: Character) -> None:
    model, body = character.model, character.body
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    assert character.mass == pytest.approx(body.mass, rel=DIGITS)
    for index, (name, part) in enumerate(zip(skeleton.JOINTS, body.parts)):
        node = model.body(name).id
        assert node == character.joint_bodies[index]
        assert model.body_mass[node] == pytest.approx(part.mass, rel=DIGITS)
        # q0 is the T-pose with the pelvis where it is at rest.
        np.testing.assert_allclose(data.xipos[node], part.com, atol=DIGITS)
        R = data.ximat[node].reshape(3, 3)
        inertia = R @ np.diag(model.body_inertia[node]) @ R.T
        np.testing.assert_allclose(inertia, part.inertia, atol=2 * DIGITS * np.abs(part.inertia).max())


def test_shapes_stand_where_the_bodys_parts_are(character: Character) -> None:
    model = character.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for part in character.body.parts:
        geom = model.geom(part.name)
        np.testing.assert_allclose(data.geom_xpos[geom.id], part.center, atol=DIGITS)
        R = data.geom_xmat[geom.id].reshape(3, 3)
        np.testing.assert_allclose(R, part.R_world_from_part, atol=DIGITS)
        used = 2 if part.shape == "capsule" else 3
        np.testing.assert_allclose(geom.size[:used], part.size[:used], rtol=DIGITS)


def test_the_text_alone_replays_a_simulation(character: Character, walk: Reference) -> None:
    assert_text_replays(character, walk, 60)


def slide(character: Character, degrees: float) -> float:
    """Speed, m/s, of half the body's weight on a foot's box, on a floor tilted by so much."""
    model = character.model
    foot = model.geom("left_ankle")
    assert foot.type == mujoco.mjtGeom.mjGEOM_BOX
    spec = mujoco.MjSpec()
    for name in ("timestep", "integrator", "cone", "impratio", "disableflags"):
        setattr(spec.option, name, getattr(model.opt, name))
    angle = np.radians(degrees)
    spec.option.gravity = 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)])

    def like(geom: mujoco.MjModel) -> dict:
        return {
            "size": geom.size,
            "friction": geom.friction,
            "solimp": geom.solimp,
            "solref": geom.solref,
            "margin": geom.margin[0],
            "condim": int(geom.condim[0]),
        }

    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, **like(model.geom("floor")))
    box = spec.worldbody.add_body(pos=[0, 0, foot.size[2]])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, mass=character.mass / 2, **like(foot))
    alone = spec.compile()
    data = mujoco.MjData(alone)
    for _ in range(100):
        mujoco.mj_step(alone, data)
    before = data.qpos[:2].copy()
    for _ in range(100):
        mujoco.mj_step(alone, data)
    return float(np.linalg.norm(data.qpos[:2] - before))


def test_a_loaded_foot_does_not_creep_and_slides_where_it_must(character: Character) -> None:
    creep = [slide(character, degrees) for degrees in (0.0, 5.0, 15.0)]
    assert creep[0] < 1e-6
    assert creep[1] < 0.002
    assert creep[2] < 0.005
    # Friction 1 holds up to 45 degrees.
    expected = 9.81 * (np.sin(np.radians(55)) - np.cos(np.radians(55))) * 1.5
    assert slide(character, 55.0) == pytest.approx(expected, rel=0.05)


def test_dense_and_sparse_solvers_agree(character: Character, moments: list) -> None:
    # MuJoCo 4.0.0 is known to build a wrong Newton Hessian on the sparse path. The Hessian only
    # steers the iteration; a larger difference would mean that the answer itself is wrong.
    model = character.model
    dense, sparse = (mujoco.MjModel.from_xml_string(character.xml) for _ in range(2))
    dense.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    sparse.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    for moment in moments:
        found = []
        for m in (dense, sparse):
            data = mujoco.MjData(m)
            data.qpos[:], data.qvel[:], data.ctrl[:] = moment.q, moment.v, moment.u
            mujoco.mj_forward(m, data)
            assert data.ncon > 0
            found.append(data.qacc.copy())
        assert np.linalg.norm(found[0] - found[1]) < 1e-6 * np.linalg.norm(found[0])
    assert mujoco.mj_isSparse(model) == mujoco.mj_isSparse(sparse)  # what we use


def test_rest_pose_is_the_bodys_t_pose(character: Character) -> None:
    q = np.zeros(57)
    q[:3], q[3] = character.body.joints[0], 1.0
    joints = joint_positions(character, q[None])[0]
    np.testing.assert_allclose(joints, character.body.joints, atol=DIGITS)


@pytest.mark.parametrize("clip", ["walk", "punch", "kick", "dance_a", "jump"])
def test_middle_angles_stay_away_from_gimbal_lock(character: Character, clip: str) -> None:
    angles = make_reference(read_motion(clip), character).q[:, 7:]
    for joint, axes in AXES.items():
        # Shoulders come near it in every order of axes: theirs are led past it (`gimbal`).
        if len(axes) == 3 and "shoulder" not in joint:
            middle = np.degrees(np.abs(angles[:, columns(joint)][:, 1]))
            assert np.percentile(middle, 99) < 75.0, joint


def test_angle_axes_are_the_named_ones(character: Character) -> None:
    # A knee that bends by 1 rad turns the shin about the thigh's y axis.
    model = character.model
    data = mujoco.MjData(model)
    dq = np.zeros(56)
    dq[6 + next(i for i, h in enumerate(HINGES) if h.name == "left_knee_y")] = 1.0
    q = np.zeros(57)
    q[3] = 1.0
    data.qpos[:] = integrate(q, dq)
    mujoco.mj_kinematics(model, data)
    R = data.body("left_knee").xmat.reshape(3, 3)
    c, s = np.cos(1.0), np.sin(1.0)
    np.testing.assert_allclose(R, [[c, 0, s], [0, 1, 0], [-s, 0, c]], atol=1e-12)

"""Closed-form derivatives of inverse dynamics against MuJoCo's finite differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from physique.character.model import Character
from physique.character.state import integrate
from physique.derivatives import contact, smooth
from physique.motion.read import read_motion
from physique.reference.reference import make_reference


def smooth_part(model: mujoco.MjModel, data: mujoco.MjData, v: np.ndarray, a: np.ndarray) -> list[np.ndarray]:
    """d torque by q, v and a without contact, each (56, 56), at the positions in `data`."""
    out = np.empty((3, 1, 56, 56))
    smooth.derivatives(
        *out,
        smooth.make_tree(model),
        model.opt.gravity,
        data.cdof[None],
        data.cinert[None, 1:],
        v[None],
        a[None],
    )
    return list(out[:, 0])


def test_smooth_part_of_any_state(character: Character) -> None:
    model = mujoco.MjModel.from_xml_string(character.xml)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.dof_armature[:] = 0.0
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)

    def torque(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse.copy()

    for _ in range(3):
        q = integrate(np.concatenate([[0, 0, 1, 1], np.zeros(53)]), rng.normal(size=56))
        v, a = 3 * rng.normal(size=56), 30 * rng.normal(size=56)
        torque(q, v, a)
        by_q, by_v, mass = smooth_part(model, data, v, a)
        full = np.empty((56, 56))
        mujoco.mj_fullM(model, data, full)
        np.testing.assert_allclose(mass, full, atol=1e-12 * np.abs(full).max())
        step = 1e-6 * np.eye(56)
        for got, ends in (
            (by_q, [[torque(integrate(q, s * d), v, a) for d in step] for s in (-1, 1)]),
            (by_v, [[torque(q, v + s * d, a) for d in step] for s in (-1, 1)]),
        ):
            expected = (np.array(ends[1]) - np.array(ends[0])).T / 2e-6
            np.testing.assert_allclose(got, expected, atol=1e-7 * np.abs(expected).max())


def contact_derivatives(
    character: Character, q: np.ndarray, v: np.ndarray, u: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray], contact.Contacts]:
    """d inverse dynamics by q, v, a: in closed form, and by MuJoCo's differences."""
    model = character.model
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
    mujoco.mj_forward(model, data)
    a = data.qacc.copy()
    found = contact.join(model, [contact.read(model, data)])
    assert found.ends[0] > 0
    np.testing.assert_allclose(
        found.force.ravel(), data.efc_force[: data.nefc], atol=1e-9 * (1 + np.abs(found.force).max())
    )
    least = np.linalg.eigvalsh(found.stiffness).min()
    assert least > -1e-9 * np.abs(found.stiffness).max()
    by_q, by_v, mass = ours = smooth_part(model, data, v, a)
    mass += np.diag(model.dof_armature)
    contact.subtract_derivatives(
        by_q[None], by_v[None], mass[None], smooth.make_tree(model), data.cdof[None], v[None], a[None], found
    )
    h, joint = model.opt.timestep, np.arange(6, 56)
    free = np.abs(data.actuator_force) < character.torque_limit - 1e-9
    kp, kd = np.where(free, 700.0, 0.0), np.where(free, 1.0, 0.0)
    mass[joint, joint] += h * kd + h * h * kp
    by_v[joint, joint] += h * kp
    theirs = [np.empty((56, 56)) for _ in range(3)]
    mujoco.mjd_inverseFD(model, data, 1e-7, False, *theirs, None, None, None, None)
    return ours, [x.T for x in theirs], found


def test_feet_on_the_floor(character: Character, moments: list) -> None:
    for m in moments:
        ours, theirs, found = contact_derivatives(character, m.q, m.v, m.u)
        assert np.all(found.bodies[:, 0] == -1)
        for mine, other, tolerance in zip(ours, theirs, (1e-3, 1e-5, 1e-6)):
            np.testing.assert_allclose(mine, other, atol=tolerance * np.abs(other).max())


@pytest.mark.parametrize("lift", [0.0, 0.4])
def test_parts_of_the_body_against_each_other(character: Character, lift: float) -> None:
    reference = make_reference(read_motion("punch"), character)
    seen = 0
    for t in range(0, 200, 20):
        q = reference.q[t].copy()
        q[2] += lift
        data = mujoco.MjData(character.model)
        data.qpos[:] = q
        mujoco.mj_forward(character.model, data)
        if data.ncon == 0:
            continue
        ours, theirs, found = contact_derivatives(character, q, reference.v[t], reference.q[t + 1, 7:])
        seen += int((found.bodies >= 0).all(axis=1).sum())
        # MuJoCo finds contacts of hands by iterations, too roughly for its differences of positions.
        hands = np.isin(character.model.geom_type[data.contact.geom], mujoco.mjtGeom.mjGEOM_ELLIPSOID).any()
        for mine, other, tolerance in list(zip(ours, theirs, (3e-3, 1e-5, 1e-6)))[int(hands) :]:
            np.testing.assert_allclose(mine, other, atol=tolerance * np.abs(other).max())
    assert seen > 5

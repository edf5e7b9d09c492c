"""A body that holds something: the same tree, another mass, real contact, exact derivatives."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from test_derivatives import contact_derivatives
from test_linearize import COLUMNS, analytic, differences

from physique import rotations, skeleton
from physique.body.held import Held, held_parts, parse_held
from physique.character.balance import move_com
from physique.character.held import held_geoms
from physique.character.kinematics import poses
from physique.character.model import Character, empty_handed, load_character, make_character
from physique.character.start import start_state
from physique.character.state import difference, integrate
from physique.motion.read import read_motion
from physique.reference.reference import Reference, carry, make_reference
from replay import assert_text_replays

OBJECTS = [("stick:2kg", "right"), ("block:5kg:0.3m", "both"), ("stick:10kg:2m", "left")]


def holding(character: Character, text: str, hand: str = "right") -> Character:
    return make_character(character.body, 100.0, parse_held(text, hand))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def loaded(character: Character) -> Character:
    """The average body with 5 kg in the right hand."""
    return holding(character, "stick:5kg")


@pytest.mark.parametrize(("text", "hand"), OBJECTS)
def test_no_coordinate_more(character: Character, text: str, hand: str) -> None:
    model, bare = holding(character, text, hand).model, character.model
    assert (model.nq, model.nv, model.nu, model.nbody) == (57, 56, 50, bare.nbody)
    assert np.array_equal(model.body_parentid, bare.body_parentid)
    assert np.array_equal(model.body_pos, bare.body_pos)


@pytest.mark.parametrize(("text", "hand"), OBJECTS)
def test_mass_and_inertia_are_mujocos_own_of_body_and_object(
    character: Character, text: str, hand: str
) -> None:
    """The object as a body of its own, welded to the hand, is the oracle."""
    held = parse_held(text, hand)  # type: ignore[arg-type]
    model = holding(character, text, hand).model
    spec = mujoco.MjSpec.from_string(character.xml)
    for joint, part in held_parts(held, character.body).items():
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, part.R_world_from_part.ravel())
        child = spec.body(joint).add_body()
        child.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE if part.shape == "capsule" else mujoco.mjtGeom.mjGEOM_BOX,
            size=part.size,
            mass=part.mass,
            quat=quat,
            pos=part.center - character.body.joints[skeleton.INDEX[joint]],
        )
    welded = spec.compile()
    q = read_motion("walk", start=0.4, end=0.5)
    reference = make_reference(q, character)
    full = []
    for m in (model, welded):
        data = mujoco.MjData(m)
        data.qpos[:] = reference.q[3]
        mujoco.mj_forward(m, data)
        M = np.zeros((56, 56))
        mujoco.mj_fullM(m, data, M)
        full.append((M, data.qfrc_bias.copy(), data.subtree_com[1].copy()))
    for mine, other in zip(*full):
        np.testing.assert_allclose(mine, other, atol=2e-5 * np.abs(other).max())
    assert model.body_subtreemass[0] == pytest.approx(character.mass + held.mass * len(held.hands), rel=1e-5)


def test_it_touches_floor_and_body_but_not_its_own_arm(character: Character) -> None:
    held = holding(character, "stick:2kg:4m", "both")
    model = held.model
    data = mujoco.MjData(model)
    seen = set()
    rng = np.random.default_rng(2)
    for _ in range(200):
        q = np.zeros(57)
        q[2], q[3] = 0.9, 1.0
        q[7:] = rng.uniform(-1.5, 1.5, 50)
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        for contact in data.contact:
            names = {model.geom(contact.geom1).name, model.geom(contact.geom2).name}
            if "held_right" in names:
                seen |= names - {"held_right"}
    assert {"floor", "pelvis", "left_hip", "right_hip", "head", "right_shoulder"} <= seen
    assert not seen & {"right_wrist", "right_elbow", "held_left"}


def test_what_is_listed_is_what_was_made(character: Character) -> None:
    assert held_geoms(character.model) == ()
    loaded = holding(character, "block:5kg:0.3m", "both")
    parts = held_parts(Held("block", 5.0, 0.3, "both"), character.body)
    found = held_geoms(load_character(loaded.xml, character.body).model)
    assert [g.name for g in found] == ["held_left", "held_right"]
    for geom, (joint, part) in zip(found, parts.items()):
        assert (geom.shape, geom.joint) == (part.shape, skeleton.INDEX[joint])
        np.testing.assert_allclose(geom.size, part.size, atol=1e-6)
        np.testing.assert_allclose(geom.center, part.center - character.body.joints[geom.joint], atol=1e-6)
        np.testing.assert_allclose(geom.R_joint_from_geom, part.R_world_from_part, atol=1e-6)
        assert loaded.model.geom(geom.geom).name == geom.name
    assert held_geoms(empty_handed(loaded).model) == ()
    assert empty_handed(loaded).xml == character.xml


def test_a_step_is_differentiated_with_the_object_too(
    character: Character, loaded: Character, moments: list
) -> None:
    data = mujoco.MjData(loaded.model)

    def step(q: np.ndarray, v: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mujoco.mj_resetData(loaded.model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
        mujoco.mj_step(loaded.model, data)
        return data.qpos.copy(), data.qvel.copy()

    for m in moments[:2]:
        expected, got = differences(step, m.q, m.v, m.u), analytic(loaded, m.q, m.v, m.u)
        for name, columns in COLUMNS.items():
            error = np.linalg.norm(got[:, columns] - expected[:, columns])
            assert error < 2e-3 * np.linalg.norm(expected[:, columns]), name


@pytest.mark.parametrize("text", ["stick:5kg", "block:5kg"])
def test_contact_of_the_object_with_the_floor(character: Character, text: str) -> None:
    loaded = holding(character, text)
    model = loaded.model
    data = mujoco.MjData(model)
    (geom,) = held_geoms(model)
    seen = 0
    for turn in (0.3, 0.8):
        # Lying face down in the air, the object 1 mm in the floor.
        q = np.zeros(57)
        q[3:7] = rotations.from_euler("xyz", np.array([turn, 1.2, 0.2]))
        q[2] = 2.0
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        lowest = poses(loaded, q[None]).lowest[0, geom.geom]
        q[2] -= lowest + 0.001
        v = 0.3 * np.random.default_rng(0).normal(size=56)
        ours, theirs, found = contact_derivatives(loaded, q, v, q[7:])
        seen += int((found.bodies[:, 1] == model.geom_bodyid[geom.geom] - 1).sum())
        for mine, other, tolerance in zip(ours, theirs, (3e-3, 1e-5, 1e-6)):
            np.testing.assert_allclose(mine, other, atol=tolerance * np.abs(other).max())
    assert seen


def test_the_start_has_the_object_out_of_body_and_floor(character: Character) -> None:
    # A stick of 2 m in a hanging hand is in the legs and the floor at once.
    loaded = holding(character, "stick:3kg:2m", "both")
    reference = make_reference(read_motion("walk", start=0.3, end=0.5), loaded)
    bare = make_reference(read_motion("walk", start=0.3, end=0.5), character)
    q = reference.q[0].copy()
    q[7:][[h for h in range(50) if "wrist_y" in loaded.model.joint(1 + h).name]] += 0.6
    objects = [g.geom for g in held_geoms(loaded.model)]
    data = mujoco.MjData(loaded.model)

    def deepest(q: np.ndarray) -> float:
        data.qpos[:] = q
        mujoco.mj_fwdPosition(loaded.model, data)
        return min((c.dist for c in data.contact if c.geom1 in objects or c.geom2 in objects), default=np.inf)

    assert deepest(q) < -0.01
    start, _ = start_state(loaded, q, reference.v[0], reference.contacts[0])
    assert deepest(start) > -1e-4
    # The arms gave way: the body was not lifted for a stick's sake.
    assert start[2] - q[2] < 0.01
    assert abs(reference.q[0, 2] - bare.q[0, 2]) < 0.02


def test_the_reference_is_moved_against_the_object(
    character: Character, loaded: Character, walk: Reference
) -> None:
    q = walk.q[40:160:4]
    moved = carry(loaded, q)
    before, full, after = (poses(character, q).com, poses(loaded, q).com, poses(loaded, moved).com)
    aside = np.linalg.norm((full - before)[:, :2].mean(axis=0))
    left = np.linalg.norm((after - before)[:, :2].mean(axis=0))
    assert aside > 0.01
    assert left < 0.3 * aside
    for side in ("left_ankle", "right_ankle"):
        foot = skeleton.INDEX[side]
        gap = poses(loaded, moved).joints[:, foot] - poses(loaded, q).joints[:, foot]
        assert np.abs(gap).max() < 1e-3


def test_no_weight_shift_where_nothing_is_held(character: Character, walk: Reference) -> None:
    q = walk.q[:3]
    com = poses(character, q).com[:, :2]
    np.testing.assert_allclose(move_com(character, q, com, np.ones(56), 15.0), q, atol=1e-9)


def test_the_least_change_is_a_minimum(loaded: Character, walk: Reference) -> None:
    """No small change of the pose that keeps the feet is cheaper."""
    q = walk.q[60:61]
    resistance, pull = np.full(56, 2.0), 300.0
    com = poses(loaded, q).com[:, :2] + [[0.0, 0.03]]
    best = move_com(loaded, q, com, resistance, pull)

    def cost(pose: np.ndarray) -> float:
        d = difference(q[0], pose)
        miss = poses(loaded, pose[None]).com[0, :2] - com[0]
        return float(resistance @ d**2 + pull * miss @ miss)

    data = mujoco.MjData(loaded.model)
    data.qpos[:] = best[0]
    mujoco.mj_kinematics(loaded.model, data)
    mujoco.mj_comPos(loaded.model, data)
    J = np.zeros((12, 56))
    for i, side in enumerate(("left_ankle", "right_ankle")):
        body = loaded.model.body(side).id
        mujoco.mj_jacBody(loaded.model, data, J[6 * i : 6 * i + 3], J[6 * i + 3 : 6 * i + 6], body)
    free = np.eye(56) - np.linalg.pinv(J) @ J
    rng = np.random.default_rng(0)
    for _ in range(20):
        d = free @ rng.normal(size=56)
        d *= 1e-3 / np.linalg.norm(d)
        slope = (cost(integrate(best[0], d)) - cost(integrate(best[0], -d))) / 2e-3
        assert abs(slope) < 0.02 * np.sqrt(cost(q[0]))


def test_the_text_alone_replays_it(loaded: Character, walk: Reference) -> None:
    assert_text_replays(loaded, walk, 40)

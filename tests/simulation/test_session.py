"""The live session: the same bits as a roll-out, and pushes that give exactly their impulse."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.character import kinematics
from physique.character.model import Character
from physique.reference.reference import Reference
from physique.render.skin import joint_transforms
from physique.simulation.rollout import simulate
from physique.simulation.session import NEAR_MISS, Hit, Session
from physique.simulation.stepper import Stepper

Array = NDArray[np.float64]
HEAD, CHEST, PELVIS = (skeleton.INDEX[name] for name in ("head", "spine3", "pelvis"))


def state(walk: Reference, height: float = 0.0, frame: int = 45) -> tuple[Array, Array, Array]:
    """A state of the walk, lifted by `height`, m, and its angles as targets."""
    q = walk.q[frame].copy()
    q[2] += height
    return q, walk.v[frame].copy(), walk.q[frame, 7:].copy()


@pytest.fixture(scope="module")
def in_the_air(character: Character, walk: Reference) -> tuple[Session, Session]:
    """Two sessions in the same walking pose, 5 m up."""
    q, v, _ = state(walk, height=5.0)
    return Session(character, q, v), Session(character, q, v)


def momentum(character: Character, q: Array, v: Array, about: Array) -> tuple[Array, Array]:
    """Linear (Ns) and angular momentum about a fixed point (Nms) by MuJoCo's own sums."""
    data = mujoco.MjData(character.model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(character.model, data)
    mujoco.mj_subtreeVel(character.model, data)
    linear = character.mass * data.subtree_linvel[1]
    return linear, data.subtree_angmom[1] + np.cross(data.subtree_com[1] - about, linear)


def test_without_a_push_it_is_the_roll_out(character: Character, walk: Reference) -> None:
    q, v, _ = state(walk)
    control = walk.q[46:86, 7:]
    expected, _ = simulate(Stepper(character.model), q, v, 40, lambda t, *_: control[t])
    session = Session(character, walk.q[0], walk.v[0])
    session.step(control[0])
    session.restart(q, v)
    for t in range(40):
        assert np.array_equal(session.q, expected.q[t])
        assert np.array_equal(session.v, expected.v[t])
        # Questions in between change nothing.
        _ = session.poses, session.cast(np.array([3.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0]))
        session.step(control[t])
        assert np.array_equal(session.torque, expected.torque[t])
    assert np.array_equal(session.q, expected.q[-1])
    assert session.steps == 40
    assert not session.diverged


@settings(max_examples=15, deadline=None)
@given(
    part=st.integers(0, 21),
    impulse=st.tuples(*[st.floats(-40.0, 40.0)] * 3),
    point=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
)
def test_a_step_of_a_push_gives_its_impulse_exactly(
    in_the_air: tuple[Session, Session], part: int, impulse: tuple[float, ...], point: tuple[float, ...]
) -> None:
    """Against the same step without it, whichever point is pushed: the gain of momentum is the
    impulse, that of angular momentum about a fixed point is lever x impulse."""
    free, pushed = in_the_air
    q, wanted = pushed.q, np.array(impulse)
    for session in in_the_air:
        session.restart(q, np.zeros(56))
    about = free.world_point(PELVIS, np.zeros(3))
    lever = free.world_point(part, np.array(point)) - about
    pushed.push(Hit(part, np.array(point)), wanted, 0.01)
    for session in in_the_air:
        session.step(q[7:])
    # Of the new velocity in the pose before the step, in which the forces act.
    after = momentum(pushed.character, q, pushed.v, about)
    before = momentum(free.character, q, free.v, about)
    size = np.linalg.norm(wanted)
    assert after[0] - before[0] == pytest.approx(wanted, abs=1e-9 * size + 1e-12)
    assert after[1] - before[1] == pytest.approx(np.cross(lever, wanted), abs=1e-9 * size + 1e-12)
    pushed.restart(q, np.zeros(56))


@pytest.mark.parametrize("part", [PELVIS, CHEST, HEAD])
def test_a_long_push_gives_its_impulse_within_the_discretisation(
    in_the_air: tuple[Session, Session], part: int
) -> None:
    """Over 0.1 s the body moves between the steps, which costs what vanishes with the push."""
    free, pushed = in_the_air
    q, about = pushed.q, np.zeros(3)

    def error(size: float) -> float:
        wanted = size * np.array([0.6, 0.8, 0.0])
        for session in in_the_air:
            session.restart(q, np.zeros(56))
        pushed.push(Hit(part, np.zeros(3)), wanted)
        for session in in_the_air:
            for _ in range(10):
                session.step(q[7:])
        gain = momentum(pushed.character, pushed.q, pushed.v, about)[0]
        gain -= momentum(free.character, free.q, free.v, about)[0]
        return float(np.linalg.norm(gain - wanted)) / size

    assert error(20.0) < 0.03
    assert error(2.0) < 0.2 * error(20.0)


def test_pushed_sessions_repeat_and_pushes_end(character: Character, walk: Reference) -> None:
    q, v, targets = state(walk)
    push = Hit(CHEST, np.zeros(3)), np.array([0.0, 20.0, 0.0])
    ends = []
    for _ in range(2):
        session = Session(character, q, v)
        session.push(*push)
        for _ in range(30):
            session.step(targets)
        ends.append(session.q)
    assert np.array_equal(*ends)
    undisturbed = Session(character, q, v)
    for _ in range(30):
        undisturbed.step(targets)
    assert np.abs(ends[0] - undisturbed.q).max() > 0.01
    # A restart takes a push away that is under way.
    session.restart(q, v)
    session.push(*push)
    session.step(targets)
    session.restart(q, v)
    for _ in range(30):
        session.step(targets)
    assert np.array_equal(session.q, undisturbed.q)


def test_rays_hit_what_is_in_their_way(character: Character, walk: Reference) -> None:
    q, v, _ = state(walk)
    session = Session(character, q, v)
    for name, side in (("head", [0, 0, 1]), ("left_wrist", [0, 1, 0]), ("right_foot", [1, 0, 0])):
        part, out = skeleton.INDEX[name], np.array(side, dtype=float)
        centre = character.body.parts[part].center - character.body.joints[part]
        middle = session.world_point(part, centre)
        hit = session.cast(middle + 2.0 * out, -out)
        assert hit is not None
        assert hit.part == part
        # On the ray, on the near side of the part.
        beyond = session.world_point(hit.part, hit.point) - middle
        assert np.linalg.norm(np.cross(beyond, out)) < 1e-9
        assert 0.0 < beyond @ out < 0.3
    top = session.world_point(HEAD, np.zeros(3))
    assert session.cast(top + np.array([0.0, 3.0, 0.0]), np.array([0.0, 1.0, 0.0])) is None
    assert session.cast(top + np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0])) is None


def test_a_near_miss_hits_the_nearest_part(character: Character, walk: Reference) -> None:
    q, v, _ = state(walk)
    session = Session(character, q, v)
    part = character.body.parts[HEAD]
    size = character.model.geom_rbound[character.model.geom("head").id]
    over = session.world_point(HEAD, part.center - character.body.joints[HEAD])
    over = over + np.array([-2.0, 0.0, size + 0.5 * NEAR_MISS])
    hit = session.cast(over, np.array([1.0, 0.0, 0.0]))
    assert hit is not None
    assert hit.part == HEAD
    assert session.cast(over + np.array([0.0, 0.0, NEAR_MISS]), np.array([1.0, 0.0, 0.0])) is None


def test_the_floor_carries_a_standing_body(character: Character, walk: Reference) -> None:
    """Averaged over a second of standing the floor's forces are the weight."""
    q = walk.q[0].copy()
    q[3:7], q[7:] = [1.0, 0.0, 0.0, 0.0], 0.0
    q[2] += 0.002 - _lowest(character, q)
    session = Session(character, q, np.zeros(56))
    up = []
    for _ in range(100):
        session.step(np.zeros(50))
        feet, pressure, other = session.floor_forces
        up.append(feet[:, 2].sum() + other[2])
    assert np.mean(up[20:]) == pytest.approx(9.81 * character.mass, rel=0.03)
    assert feet.min(axis=0)[2] > 0
    assert pressure[0, 1] > pressure[1, 1]


def test_its_poses_are_those_of_the_joints(character: Character, walk: Reference) -> None:
    q, v, targets = state(walk)
    session = Session(character, q, v)
    session.step(targets)
    poses = session.poses
    assert np.allclose(poses[:, :3], kinematics.joint_positions(character, session.q[None])[0])
    expected = joint_transforms(character.body, session.q[None])[0]
    assert np.allclose(poses[:, :3], expected[..., 3], atol=1e-5)
    assert np.allclose(rotations.to_matrix(poses[:, 3:]), expected[..., :3], atol=1e-9)


def test_a_simulation_that_blows_up_says_so(character: Character, walk: Reference) -> None:
    q, v, targets = state(walk)
    session = Session(character, q, np.full_like(v, 1e11))
    session.step(targets)
    assert session.diverged
    session.step(targets)
    assert session.steps == 1
    session.restart(q, v)
    session.step(targets)
    assert not session.diverged


def _lowest(character: Character, q: Array) -> float:
    return float(kinematics.poses(character, q[None]).lowest.min())

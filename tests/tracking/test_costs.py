"""The vectorised cost against Eqs. 2 to 8 written out, and its model against differences of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique import rotations
from physique.character.hinges import HINGES
from physique.character.kinematics import com_velocity, poses
from physique.character.model import Character
from physique.character.state import integrate
from physique.commands.inputs import parse_weights
from physique.errors import InputError
from physique.reference.reference import Reference
from physique.reference.target import MOST, TERMS, Target, Weights, joint_weights, upright_weights
from physique.tracking import costs
from physique.tracking.costs import Quadratic

H = 0.01


@pytest.fixture(scope="module")
def target(walk: Reference) -> Target:
    return walk.target(30, 36, np.array([0.1, -0.2]))


def moved(target: Target, seed: int, scale: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = integrate(target.q, scale * rng.normal(size=(len(target.q), 56)))
    return q, target.v + rng.normal(size=target.v.shape)


def motion(character: Character, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    pose = poses(character, q)
    return q, v, pose.com, com_velocity(pose.com_jacobian, v)


def literal(target: Target, q: np.ndarray, v: np.ndarray, c: np.ndarray, cv: np.ndarray) -> dict:
    """Eqs. 3 to 8 as printed, with the weights of section 3.1, in plain loops."""
    e = dict.fromkeys(TERMS, 0.0)
    for t in range(len(q)):
        for i in range(3):
            e["com"] += 15 * (c[t][i] - target.com[t][i]) ** 2
            e["com_velocity"] += 0.5 * (cv[t][i] - target.com_velocity[t][i]) ** 2
        for j, hinge in enumerate(HINGES):
            beta = 1.0
            if hinge.joint in ("left_hip", "right_hip"):
                beta = 10.0
            if hinge.joint in ("left_shoulder", "right_shoulder"):
                beta = 3.0
            e["pose"] += 0.5 * beta * (q[t][7 + j] - target.q[t][7 + j]) ** 2
            e["velocity"] += 0.0005 * beta * (v[t][6 + j] - target.v[t][6 + j]) ** 2
        inner = sum(q[t][3 + i] * target.q[t][3 + i] for i in range(4))
        e["root"] += 4 * math.acos(min(1.0, abs(inner)))
    for t in range(len(q) - 1):
        for k in range(56):
            e["acceleration"] += 1e-10 * ((v[t + 1][k] - v[t][k]) / H) ** 2
    return e


@pytest.mark.parametrize("seed", range(3))
def test_terms_are_the_papers(character: Character, target: Target, seed: int) -> None:
    arguments = motion(character, *moved(target, seed))
    expected = literal(target, *arguments)
    got = costs.evaluate(Weights(), target, *arguments, H)
    assert set(got) == set(expected)
    for name in TERMS:
        assert float(got[name]) == pytest.approx(expected[name], rel=1e-9), name
    assert float(costs.total(got)) == pytest.approx(sum(expected.values()), rel=1e-9)


def test_a_batch_is_its_members(character: Character, target: Target) -> None:
    members = [motion(character, *moved(target, seed)) for seed in range(4)]
    together = costs.evaluate(Weights(), target, *(np.stack(a) for a in zip(*members)), H)
    for i, member in enumerate(members):
        alone = costs.evaluate(Weights(), target, *member, H)
        for name in TERMS:
            assert together[name].shape == (4,)
            assert together[name][i] == pytest.approx(float(alone[name]), rel=1e-12)


def test_the_target_itself_costs_only_its_accelerations(target: Target) -> None:
    terms = costs.evaluate(Weights(), target, target.q, target.v, target.com, target.com_velocity, H)
    assert terms["acceleration"] > 0
    assert all(terms[name] < 1e-12 for name in TERMS if name != "acceleration")


def test_a_quaternion_may_have_either_sign(character: Character, target: Target) -> None:
    q, *rest = motion(character, *moved(target, 1))
    flipped = q.copy()
    flipped[:, 3:7] *= -1
    one, other = (costs.evaluate(Weights(), target, x, *rest, H)["root"] for x in (q, flipped))
    assert other == pytest.approx(float(one), rel=1e-12)


@pytest.mark.parametrize(("angle", "tolerance"), [(1e-9, 1e-6), (1e-4, 1e-9), (1.0, 1e-12), (3.0, 1e-12)])
def test_root_term_is_half_the_angle(target: Target, angle: float, tolerance: float) -> None:
    # acos of an inner product loses all digits of an angle of 1e-9; this must not.
    q = target.q.copy()
    turn = rotations.exp(np.array([0.0, angle, 0.0]))
    q[:, 3:7] = rotations.multiply(q[:, 3:7], turn)
    terms = costs.evaluate(Weights(), target, q, target.v, target.com, target.com_velocity, H)
    assert terms["root"] == pytest.approx(4 * len(q) * angle / 2, rel=tolerance)


def model(
    character: Character, target: Target, weights: Weights, q: np.ndarray, v: np.ndarray, kink: float
) -> Quadratic:
    q, v, com, velocity = motion(character, q, v)
    jacobian = poses(character, q).com_jacobian
    return costs.expand(weights, target, q, v, com, velocity, jacobian, kink)


def frame_cost(character: Character, target: Target, weights: Weights, q: np.ndarray, v: np.ndarray) -> float:
    return float(costs.total(costs.evaluate(weights, target, *motion(character, q, v), H)))


def test_gradient_by_differences(character: Character, target: Target) -> None:
    # The model leaves the acceleration term out, and d com_velocity / d q, which is second order.
    weights = replace(Weights(), acceleration=0.0)
    frame = Target(*(a[2:3] for a in (target.q, target.v, target.com, target.com_velocity)))
    rng = np.random.default_rng(4)
    turn = np.zeros(56)
    turn[3:6] = [0.0, 0.5, 0.0]  # far from the kink of Eq. 7
    q = integrate(frame.q, (0.1 * rng.normal(size=56) * (np.arange(56) >= 6) + turn)[None])
    v = frame.v + rng.normal(size=(1, 56))
    h = 1e-6

    def along(weights: Weights, i: int) -> float:
        d = np.zeros(112)
        d[i] = h
        ends = [
            frame_cost(character, frame, weights, integrate(q, s * d[:56]), v + s * d[56:]) for s in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * h)

    still = replace(weights, com_velocity=0.0)
    gradient = model(character, frame, still, q, v, kink=0.0).gradient[0]
    expected = np.array([along(still, i) for i in range(112)])
    np.testing.assert_allclose(gradient, expected, atol=2e-5)

    moving = replace(Weights(), com=0.0, pose=0.0, velocity=0.0, root=0.0, acceleration=0.0)
    gradient = model(character, frame, moving, q, v, kink=0.01).gradient[0, 56:]
    expected = np.array([along(moving, 56 + i) for i in range(56)])
    np.testing.assert_allclose(gradient, expected, atol=1e-6)


def test_hessian_predicts_the_cost(character: Character, target: Target) -> None:
    # The terms that are squares of linear functions are met exactly, to all orders.
    weights = Weights(com=0.0, com_velocity=0.0, root=0.0, acceleration=0.0)
    q, v = moved(target, 7)
    quadratic = model(character, target, weights, q, v, 0.02)
    rng = np.random.default_rng(8)
    d = 0.3 * rng.normal(size=(len(q), 112))
    change = frame_cost(character, target, weights, integrate(q, d[:, :56]), v + d[:, 56:])
    change -= frame_cost(character, target, weights, q, v)
    predicted = np.sum(quadratic.gradient * d)
    parts = d.reshape(-1, 2, 56)
    predicted += 0.5 * np.einsum("tki,tkij,tkj->", parts, quadratic.hessian, parts)
    assert change == pytest.approx(float(predicted), rel=1e-9)


def test_hessian_is_positive_semidefinite(character: Character, target: Target) -> None:
    quadratic = model(character, target, Weights(), *moved(target, 9), 0.02)
    assert np.linalg.eigvalsh(quadratic.hessian).min() > -1e-9
    np.testing.assert_array_equal(quadratic.hessian, np.swapaxes(quadratic.hessian, -1, -2))


@settings(deadline=None)
@given(st.dictionaries(st.sampled_from(TERMS), st.floats(0, MOST)))
def test_weights_of_texts(changed: dict[str, float]) -> None:
    found = parse_weights([f"{name}={value!r}" for name, value in changed.items()], Weights())
    assert found.terms == Weights().terms | changed
    assert np.array_equal(found.joints, joint_weights())


def test_upright_weights_are_the_papers_but_for_the_spine() -> None:
    weights = upright_weights()
    assert weights.terms == Weights().terms
    changed = {
        h.name: beta for h, beta, paper in zip(HINGES, weights.joints, joint_weights()) if beta != paper
    }
    assert changed == {f"spine{i}_{axis}": 10.0 for i in (1, 2, 3) for axis in "xyz"}


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"com": -1.0}, "weight com: found -1"),
        ({"root": float("nan")}, "weight root: found nan"),
        ({"pose": float("inf")}, "weight pose: found inf"),
        ({"joints": np.ones(3)}, r"shape \(3,\); expected \(50,\)"),
        ({"joints": -np.ones(50)}, "weight of left_hip_y: found -1"),
    ],
)
def test_weights_that_cannot_be_are_refused(wrong: dict, text: str) -> None:
    with pytest.raises(InputError, match=text):
        Weights(**wrong)

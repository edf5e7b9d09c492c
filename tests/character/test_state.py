"""Differences and sums on the manifold are MuJoCo's own."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique.character.model import Character
from physique.character.state import difference, finite_velocity, integrate
from physique.reference.reference import Reference

seeds = st.integers(0, 2**32 - 1)
scales = st.sampled_from([1e-7, 1e-3, 0.1, 1.0])


def random_q(rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=57)
    q[3:7] /= np.linalg.norm(q[3:7])
    return q


@given(seed=seeds, scale=scales)
@settings(deadline=None, max_examples=60)
def test_integrate_is_mujocos(character: Character, seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    q, dq = random_q(rng), scale * rng.normal(size=56)
    expected = q.copy()
    mujoco.mj_integratePos(character.model, expected, dq, 1.0)
    got = integrate(q, dq)
    if expected[3:7] @ got[3:7] < 0:  # the same rotation
        expected[3:7] *= -1
    np.testing.assert_allclose(got, expected, atol=1e-13)


@given(seed=seeds, scale=scales)
@settings(deadline=None, max_examples=60)
def test_difference_is_mujocos(character: Character, seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    a = random_q(rng)
    b = integrate(a, np.clip(scale * rng.normal(size=56), -1.5, 1.5))
    expected = np.empty(56)
    mujoco.mj_differentiatePos(character.model, expected, 1.0, a, b)
    np.testing.assert_allclose(difference(a, b), expected, atol=1e-12)


@given(seed=seeds)
@settings(deadline=None, max_examples=60)
def test_difference_undoes_integrate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = np.stack([random_q(rng) for _ in range(3)])
    dq = rng.uniform(-1.7, 1.7, size=(3, 56))  # turns of less than pi
    np.testing.assert_allclose(difference(q, integrate(q, dq)), dq, atol=1e-12)


def test_a_quaternion_and_its_negative_are_one_orientation() -> None:
    rng = np.random.default_rng(3)
    q = random_q(rng)
    flipped = q.copy()
    flipped[3:7] *= -1
    np.testing.assert_allclose(difference(q, flipped), 0.0, atol=1e-12)


def test_finite_velocity_leads_from_each_pose_to_the_next(walk: Reference) -> None:
    v = finite_velocity(walk.q, 0.01)
    reached = integrate(walk.q[:-1], 0.01 * v[1:])
    assert np.abs(difference(reached, walk.q[1:])).max() < 1e-12
    assert v[0] == pytest.approx(v[1], abs=0)

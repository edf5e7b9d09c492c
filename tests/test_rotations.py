"""Quaternions against SciPy's: uniform, Gaussian and near-identity rotations."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from physique import rotations
from physique.rotations import Array

N = 40


def _uniform(rng: np.random.Generator) -> Rotation:
    return Rotation.random(N, rng=rng)


def _gaussian(rng: np.random.Generator) -> Rotation:
    return Rotation.from_rotvec(rng.normal(size=(N, 3)))


def _near_identity(rng: np.random.Generator) -> Rotation:
    return Rotation.from_rotvec(rng.normal(size=(N, 3)) * 10.0 ** rng.uniform(-16, -3, (N, 1)))


def _near_half_turn(rng: np.random.Generator) -> Rotation:
    axis = rng.normal(size=(N, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return Rotation.from_rotvec(axis * (np.pi - 10.0 ** rng.uniform(-12, -2, (N, 1))))


samples = st.tuples(
    st.sampled_from([_uniform, _gaussian, _near_identity, _near_half_turn]), st.integers(0, 2**32 - 1)
).map(lambda pair: pair[0](np.random.default_rng(pair[1])))
check = settings(max_examples=60, deadline=None)


def wxyz(r: Rotation) -> Array:
    return rotations.positive(r.as_quat(scalar_first=True))


def assert_same(a: Array, b: Array, tolerance: float = 1e-14) -> None:
    """The same rotations, whichever of the two signs each quaternion has."""
    distance = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    assert distance.max() < tolerance


@check
@given(samples, samples)
def test_multiply_and_conjugate(a: Rotation, b: Rotation) -> None:
    assert_same(rotations.multiply(wxyz(a), wxyz(b)), wxyz(a * b))
    assert_same(rotations.conjugate(wxyz(a)), wxyz(a.inv()))


@check
@given(samples, st.integers(0, 2**32 - 1))
def test_rotate(a: Rotation, seed: int) -> None:
    v = np.random.default_rng(seed).normal(size=(N, 3))
    np.testing.assert_allclose(rotations.rotate(wxyz(a), v), a.apply(v), atol=1e-14)


def test_rotate_broadcasts() -> None:
    q = wxyz(_uniform(np.random.default_rng(0)))
    v = np.random.default_rng(1).normal(size=(7, 1, 3))
    out = rotations.rotate(q, v)
    assert out.shape == (7, N, 3)
    np.testing.assert_allclose(out[3, 5], rotations.rotate(q[5], v[3, 0]), atol=0)


@check
@given(samples)
def test_matrices(a: Rotation) -> None:
    np.testing.assert_allclose(rotations.to_matrix(wxyz(a)), a.as_matrix(), atol=2e-15)
    assert_same(rotations.from_matrix(a.as_matrix()), wxyz(a))


@check
@given(samples)
def test_log_and_exp(a: Rotation) -> None:
    w = rotations.log(wxyz(a))
    assert np.linalg.norm(w, axis=-1).max() <= np.pi
    assert_same(rotations.exp(w), wxyz(a))
    theirs = Rotation.from_quat(wxyz(a), scalar_first=True).as_rotvec()
    np.testing.assert_allclose(w, theirs, atol=1e-13)
    assert_same(rotations.exp(theirs), wxyz(a))


@check
@given(st.integers(0, 2**32 - 1))
def test_log_of_exp_keeps_tiny_turns(seed: int) -> None:
    # A turn of 1e-16 rad must come back as that to all digits, not as zero.
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(N, 3)) * 10.0 ** rng.uniform(-30, -1, (N, 1))
    np.testing.assert_allclose(rotations.log(rotations.exp(w)), w, rtol=1e-13)


def test_exp_and_log_at_zero() -> None:
    np.testing.assert_array_equal(rotations.exp(np.zeros(3)), rotations.IDENTITY)
    np.testing.assert_array_equal(rotations.log(rotations.IDENTITY), np.zeros(3))


@pytest.mark.parametrize("order", ["".join(p) for p in permutations("xyz")])
@check
@given(a=samples)
def test_euler(order: str, a: Rotation) -> None:
    angles = rotations.to_euler(order, wxyz(a))
    assert np.abs(angles[:, 1]).max() <= np.pi / 2
    assert_same(wxyz(Rotation.from_euler(order.upper(), angles)), wxyz(a), 1e-7)
    assert_same(rotations.from_euler(order, angles), wxyz(a), 1e-7)
    # Away from gimbal lock the angles themselves are determined.
    clear = np.abs(angles[:, 1]) < 1.5
    theirs = a.as_euler(order.upper())
    difference = (angles - theirs + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(difference[clear]).max(initial=0.0) < 1e-12


@pytest.mark.parametrize("order", ["zxy", "xyz", "yx", "z"])
def test_from_euler(order: str) -> None:
    angles = np.random.default_rng(3).uniform(-np.pi, np.pi, (5, 6, len(order)))
    flat = angles.reshape(-1, len(order))
    theirs = Rotation.from_euler(order.upper(), flat)
    assert_same(rotations.from_euler(order, angles).reshape(-1, 4), wxyz(theirs))


@pytest.mark.parametrize("order", ["zxy", "xyz"])
def test_unwrapped_angles_run_on_through_half_turns(order: str) -> None:
    """Two somersaults about each axis come back as they were, from principal values."""
    way = np.zeros((3, 90, 3))
    for k in range(3):
        way[k, :, k] = np.linspace(0.0, 4 * np.pi, 90)
    way = np.swapaxes(way, 0, 1)  # (T, 3 joints, 3)
    found = rotations.unwrap_euler(rotations.to_euler(order, rotations.from_euler(order, way)))
    np.testing.assert_allclose(found, way, atol=1e-6)


def test_to_euler_wants_three_axes() -> None:
    with pytest.raises(ValueError, match="'zxz' must name three different axes"):
        rotations.to_euler("zxz", rotations.IDENTITY)


def test_about() -> None:
    angles = np.linspace(-3, 3, 7)
    for axis in "xyz":
        assert_same(rotations.about(axis, angles), wxyz(Rotation.from_euler(axis, angles[:, None])))


@check
@given(samples, samples, st.floats(0, 1))
def test_slerp(a: Rotation, b: Rotation, t: float) -> None:
    ours = rotations.slerp(wxyz(a), wxyz(b), np.full(N, t))
    theirs = [
        Slerp([0, 1], Rotation.concatenate([a[i], b[i]]))(t).as_quat(scalar_first=True) for i in range(N)
    ]
    # Of two ways that are equally long (to rounding) either may be taken.
    clear = (a.inv() * b).magnitude() < np.pi - 1e-6
    if clear.any():
        assert_same(ours[clear], np.array(theirs)[clear], 1e-12)


def test_slerp_keeps_its_ends() -> None:
    rng = np.random.default_rng(5)
    a, b = wxyz(_uniform(rng)), wxyz(_uniform(rng))
    assert_same(rotations.slerp(a, -b, np.zeros(N)), a)
    assert_same(rotations.slerp(a, -b, np.ones(N)), b)


@pytest.mark.parametrize("draw", [_uniform, _gaussian, _near_identity, _near_half_turn])
def test_results_are_unit_and_positive(draw: Callable[[np.random.Generator], Rotation]) -> None:
    rng = np.random.default_rng(6)
    a, b = draw(rng), draw(rng)
    scaled = -3.7 * a.as_quat(scalar_first=True)
    for q in (
        rotations.normalize(scaled),
        rotations.from_matrix(a.as_matrix()),
        rotations.slerp(wxyz(a), wxyz(b), np.linspace(0, 1, N)),
    ):
        np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1, atol=1e-15)
        assert (q[:, 0] >= 0).all()
    assert_same(rotations.normalize(scaled), wxyz(a))

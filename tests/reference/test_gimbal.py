"""Angles near gimbal lock: calm, and where they were elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from physique import rotations
from physique.character.hinges import AXES, columns
from physique.reference.gimbal import calm

OWN = columns("left_shoulder")
AXES_OWN = AXES["left_shoulder"]


def past_the_pole(miss: float) -> np.ndarray:
    """Angles (T, 50) of an arm that swings past the pole of its middle axis within `miss` rad."""
    t = np.linspace(-1.0, 1.0, 120)
    swing = rotations.from_euler("yx", np.stack([np.pi / 2 + t, np.full_like(t, miss)], axis=1))
    angles = np.zeros((len(t), 50))
    euler = rotations.to_euler(AXES_OWN, swing)
    for k in range(3):
        angles[:, OWN.start + k] = np.unwrap(euler[:, k])
    return angles


def turned(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (T,), rad, between the rotations of two sets of angles."""
    p, q = (rotations.from_euler(AXES_OWN, x[:, OWN]) for x in (a, b))
    return np.linalg.norm(rotations.log(rotations.multiply(rotations.conjugate(p), q)), axis=-1)


@pytest.mark.parametrize("miss", [0.002, 0.02, 0.05])
def test_a_spin_near_the_pole_is_led_past_it(miss: float) -> None:
    spinning = past_the_pole(miss)
    assert np.abs(np.diff(spinning, axis=0)).max() > 0.3  # 30 rad/s
    found = calm(spinning, 0.01)
    assert np.abs(np.diff(found, axis=0)).max() < 0.5 * np.abs(np.diff(spinning, axis=0)).max()
    assert np.abs(np.diff(found, 2, axis=0)).max() < 0.5 * np.abs(np.diff(spinning, 2, axis=0)).max()
    away = turned(spinning, found)
    assert away.max() < 0.2
    assert np.median(away) < 0.02


def test_angles_that_turn_slowly_stay_as_they_are() -> None:
    rng = np.random.default_rng(2)
    angles = np.cumsum(rng.normal(scale=0.05, size=(80, 50)), axis=0)
    assert np.array_equal(calm(angles, 0.01), angles)


def test_other_joints_stay_as_they_are() -> None:
    spinning = past_the_pole(0.01)
    spinning[:, 30:] = np.linspace(0.0, 1.0, 120)[:, None] if OWN.stop <= 30 else 0.0
    found = calm(spinning, 0.01)
    others = np.setdiff1d(np.arange(50), np.arange(50)[OWN])
    assert np.array_equal(found[:, others], spinning[:, others])

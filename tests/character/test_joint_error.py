"""The one measure of how far a body is from where it should be."""

from __future__ import annotations

import numpy as np
import pytest

from physique.character.joint_error import joint_errors, mean_joint_error


def test_the_mean_error_is_the_mean_distance() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 22, 3))
    by_hand = [sum((x - y) ** 2 for x, y in zip(p, q, strict=True)) ** 0.5 for p, q in zip(a, b, strict=True)]
    assert joint_errors(a, b) == pytest.approx(by_hand)
    assert mean_joint_error(a, b) == pytest.approx(sum(by_hand) / 22)
    assert joint_errors(np.array([a, b]), b).shape == (2, 22)

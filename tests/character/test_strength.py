"""Torque limits: the published table at its own body, and how they grow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.character.hinges import HINGES
from physique.character.strength import REFERENCE_HEIGHT, REFERENCE_MASS, torque_limits

#: Nm, of a man of 75 kg and 1.75 m, from the papers that the module names.
SOME = {
    "left_hip_y": 260.0,
    "right_hip_z": 80.0,
    "left_knee_y": 250.0,
    "right_ankle_y": 220.0,
    "left_foot_y": 60.0,
    "spine1_x": 140.0,
    "spine3_y": 210.0,
    "neck_z": 15.0,
    "right_collar_x": 95.0,
    "left_shoulder_y": 60.0,
    "right_elbow_z": 72.0,
    "left_wrist_y": 9.0,
}


def test_the_reference_body_has_the_table() -> None:
    limits = dict(zip((hinge.name for hinge in HINGES), torque_limits(REFERENCE_MASS, REFERENCE_HEIGHT)))
    assert len(limits) == 50
    assert {name: limits[name] for name in SOME} == SOME


def test_left_and_right_are_alike() -> None:
    limits = dict(zip((hinge.name for hinge in HINGES), torque_limits(62.0, 1.6)))
    for name, limit in limits.items():
        assert limit == limits[name.replace("left_", "right_")]


@given(st.floats(40.0, 160.0), st.floats(1.4, 2.1))
def test_they_grow_with_the_area_of_muscle_and_the_lever(mass: float, height: float) -> None:
    grown = torque_limits(8.0 * mass, height) / torque_limits(mass, height)
    assert grown == pytest.approx(4.0)
    taller = torque_limits(mass, 1.1 * height) / torque_limits(mass, height)
    assert taller == pytest.approx(1.1)
    assert np.all(torque_limits(mass, height) > 0.0)

"""Each thing that derivatives and simulation take for granted is looked at."""

from __future__ import annotations

import re

import pytest

from physique.character.model import Character, load_character
from physique.errors import InputError


def change(xml: str, pattern: str, text: str) -> str:
    changed, count = re.subn(pattern, text, xml, count=1)
    assert count == 1, pattern
    return changed


@pytest.mark.parametrize(
    ("pattern", "text", "what"),
    [
        ('timestep="0.01"', 'timestep="0.02"', "time step"),
        ('integrator="discrete"', 'integrator="implicitfast"', "integrator"),
        ('cone="elliptic"', 'cone="pyramidal"', "friction cone"),
        ('warmstart="disable"', 'warmstart="enable"', "flags"),
        ('warmstart="disable"', r'\g<0> contact="disable"', "flags"),
        ("<option ", '<option gravity="0 0 -1.62" ', "gravity"),
        ("<option ", '<option density="1.2" ', "medium"),
        ('joint name="left_knee_y"', r'\g<0> range="-2 2" limited="true"', "joint limits"),
        ('joint name="left_knee_y"', r'\g<0> damping="1"', "passive forces"),
        ('joint name="left_knee_y"', r'\g<0> stiffness="1"', "passive forces"),
        ('joint name="left_knee_y"', r'\g<0> frictionloss="1"', "passive forces"),
        ('joint name="left_knee_y"', r'\g<0> type="slide"', "joint types"),
        ('body name="left_knee"', r'\g<0> gravcomp="1"', "passive forces"),
        ("<sensor>", '<equality><joint joint1="left_knee_y"/></equality><sensor>', "constraints"),
        ('geom name="left_knee"', r'\g<0> condim="1"', "contact dimensions"),
        ('(geom name="left_knee"[^>]*)type="capsule"', r'\1type="cylinder"', "shapes"),
        ('geom name="left_ankle"', 'geom name="left_sole"', "feet"),
        ('geom name="floor"', r'\g<0> pos="0 0 0.1"', "floor"),
        ('joint="left_knee_y"', r'\g<0> gear="2"', "actuators"),
        ('joint="left_knee_y"', r'\g<0> ctrlrange="-1 1" ctrllimited="true"', "actuators"),
        ('biasprm="0 -700 -1"', 'biasprm="0 -600 -1"', "servos"),
        ('biastype="affine" ', "", "servos"),
        ('forcerange="-100 100"', 'forcerange="-100 90"', "torque limits"),
        ('forcerange="-100 100"', "", "torque limits"),
        ("<subtreecom[^>]*>", "", "sensors"),
    ],
)
def test_other_models_are_refused(character: Character, pattern: str, text: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        load_character(change(character.xml, pattern, text), character.body)

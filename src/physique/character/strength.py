"""Torque limits that fit a body: published joint strengths, scaled by mass and stature.

The values are approximate and rounded, those of young men, the stronger way. Legs: peak moments in
fast running and jumping, which exceed what dynamometers measure, since muscles resist stretching
with more force than they shorten: 3 to 3.5 Nm/kg at hip, knee and ankle (Novacheck, Gait & Posture
7, 1998; Schache et al., Med. Sci. Sports Exerc. 43, 2011), 0.8 Nm/kg at the toes (Stefanyshyn and
Nigg, J. Biomech. 30, 1997); hip abduction and rotation from Cahalan et al. (Clin. Orthop. 246,
1989), raised alike. Trunk from McNeill et al. (Spine 5, 1980) and Kumar (Spine 21, 1996); neck from
Vasavada et al. (Spine 26, 2001); shoulder from Otis et al. (J. Bone Joint Surg. 72, 1990); elbow
from Askew et al. (Clin. Orthop. 222, 1987); wrist from Delp et al. (J. Biomech. 29, 1996). Muscle
force grows with the two-thirds power of body mass (Jaric, Sports Med. 32, 2002) and its lever arm
with stature.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.character.hinges import HINGES

#: The body that the table holds for.
REFERENCE_MASS = 75.0  # kg
REFERENCE_HEIGHT = 1.75  # m

#: Nm about the axes x, y, z of the T-pose: for legs and trunk x is sideways, y flexion and z
#: twist; for arms, which point along y, x is up and down, y twist and z forward and back.
STRENGTH: dict[str, dict[str, float]] = {
    "hip": {"x": 160.0, "y": 260.0, "z": 80.0},
    "knee": {"y": 250.0},
    "ankle": {"x": 50.0, "y": 220.0, "z": 45.0},
    "foot": {"y": 60.0},
    "spine": {"x": 140.0, "y": 210.0, "z": 100.0},
    "neck": {"x": 36.0, "y": 52.0, "z": 15.0},
    "collar": {"x": 95.0, "y": 95.0, "z": 95.0},
    "shoulder": {"x": 95.0, "y": 60.0, "z": 95.0},
    "elbow": {"y": 60.0, "z": 72.0},
    "wrist": {"x": 12.0, "y": 9.0, "z": 12.0},
}


def torque_limits(mass: float, height: float) -> NDArray[np.float64]:
    """Limits (50,), Nm, of a body of this mass (kg) and stature (m)."""
    scale = (mass / REFERENCE_MASS) ** (2 / 3) * (height / REFERENCE_HEIGHT)
    return np.array([scale * _strength(hinge.joint)[hinge.axis] for hinge in HINGES])


def _strength(joint: str) -> dict[str, float]:
    return STRENGTH[joint.removeprefix("left_").removeprefix("right_").rstrip("123")]

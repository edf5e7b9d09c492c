"""What a motion should look like, and how much each kind of departure counts (Eq. 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from physique.character.hinges import HINGES
from physique.errors import InputError

Array = NDArray[np.float64]

TERMS = ("com", "com_velocity", "pose", "velocity", "root", "acceleration")


#: The greatest weight: far beyond any use, and squares of it are still numbers.
MOST = 1e9


def joint_weights(spine: float = 1.0) -> Array:
    """beta of Eqs. 5 and 6, (50,): hips 10, shoulders 3, all others 1; the spine's as given."""
    by_joint = {"_hip": 10.0, "_shoulder": 3.0, "spine": spine}
    return np.array([next((w for part, w in by_joint.items() if part in h.joint), 1.0) for h in HINGES])


@dataclass(frozen=True)
class Weights:
    """w of Eq. 2; the defaults are those of section 3.1. `acceleration` is the paper's w_jerk (Eq. 8).

    joints: (50,), beta of Eqs. 5 and 6. Raises InputError for a weight that is no number from 0 to
    1e9.
    """

    com: float = 15.0
    com_velocity: float = 0.5
    pose: float = 0.5
    velocity: float = 0.0005
    root: float = 4.0
    acceleration: float = 1e-10
    joints: Array = field(default_factory=joint_weights)

    def __post_init__(self) -> None:
        if self.joints.shape != (len(HINGES),):
            raise InputError(
                "weights joints",
                f"shape {self.joints.shape}",
                f"({len(HINGES)},)",
                "give one of each joint angle",
            )
        of_joints = {f"of {hinge.name}": beta for hinge, beta in zip(HINGES, self.joints)}
        for name, value in (self.terms | of_joints).items():
            if not (math.isfinite(value) and 0.0 <= value <= MOST):
                raise InputError(f"weight {name}", f"{value:g}", f"0 to {MOST:g}", "correct the value")

    @property
    def terms(self) -> dict[str, float]:
        """The weight of each term of E."""
        return {name: float(getattr(self, name)) for name in TERMS}


def upright_weights() -> Weights:
    """The paper's weights, but for the spine, whose joints count as much as the hips'.

    The paper itself names "excessive motion in the lumbar spine" as a fault; docs/fast.md has what it does.
    """
    return Weights(joints=joint_weights(spine=10.0))


@dataclass(frozen=True)
class Target:
    """What T frames should look like: q (T, 57), v (T, 56), com (T, 3), com_velocity (T, 3)."""

    q: Array
    v: Array
    com: Array
    com_velocity: Array

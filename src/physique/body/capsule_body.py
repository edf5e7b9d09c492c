"""What the simulator needs to know of a person: 22 rigid parts with simple shapes and masses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Shape = Literal["capsule", "box", "ellipsoid"]


@dataclass(frozen=True)
class Part:
    """One rigid part of the body, named after the joint that moves it, in the T-pose world frame.

    shape: the primitive. `size` (3,) m is: capsule (radius, half length of the cylinder, 0) with
        the axis along the primitive's own z; box: three half extents; ellipsoid: three semi-axes.
    center: (3,) m, of the primitive.
    R_world_from_part: (3, 3), orientation of the primitive.
    mass: kg.
    com: (3,) m, centre of mass.
    inertia: (3, 3) kg m2, about `com`, along the world axes.
    """

    name: str
    shape: Shape
    size: NDArray[np.float64]
    center: NDArray[np.float64]
    R_world_from_part: NDArray[np.float64]
    mass: float
    com: NDArray[np.float64]
    inertia: NDArray[np.float64]


@dataclass(frozen=True)
class CapsuleBody:
    """A person as primitives on a skeleton (section 3.3), in the T-pose, soles on z = 0.

    joints: (22, 3) m, rest positions of `skeleton.JOINTS`.
    parts: 22, in the order of `skeleton.JOINTS`.
    excluded: pairs of part indices that overlap at rest and so never collide.
    height: m. mass: kg, the sum over the parts.
    """

    name: str
    height: float
    mass: float
    joints: NDArray[np.float64]
    parts: tuple[Part, ...]
    excluded: tuple[tuple[int, int], ...]

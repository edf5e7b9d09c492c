"""What a person holds: a stick or a block in a closed hand, as a rigid shape beside the hand's.

In the T-pose palms face down. A stick lies under the palm, held at its middle, and runs across it:
forward and back. A block hangs from the hand by its near face, as a case or a kettlebell does:
beyond the hand's middle, where the fingers point.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from physique import skeleton
from physique.body.capsule_body import CapsuleBody, Part
from physique.body.primitives import Primitive, inertia
from physique.errors import InputError

Array = NDArray[np.float64]

Shape = Literal["stick", "block"]
Hand = Literal["right", "left", "both"]

#: m: a stick's length, a block's edge where the text names none.
DEFAULT_SIZE: dict[Shape, float] = {"stick": 1.0, "block": 0.2}
#: m, the least and the greatest of those.
SIZES: dict[Shape, tuple[float, float]] = {"stick": (0.1, 4.0), "block": (0.04, 1.0)}
#: Of the objects' names; the side follows.
PREFIX = "held_"
STICK_RADIUS = 0.015  # m, what a hand closes round
MASSES = (0.001, 100.0)  # kg, the least and the greatest

_EXAMPLES = "stick:2kg, stick:2.0kg:1.2m, block:5kg or block:5kg:0.3m"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FORM = re.compile(rf"(\w+):({_NUMBER})(\w*)(?::({_NUMBER})(\w*))?", re.ASCII)


@dataclass(frozen=True)
class Held:
    """A stick or a cube that a hand holds; with hand "both", one such object in each.

    mass: kg, of one object. size: m, the stick's length or the cube's edge.
    Raises InputError for a shape, hand, mass or size that cannot be.
    """

    shape: Shape
    mass: float
    size: float
    hand: Hand = "right"

    def __post_init__(self) -> None:
        _check_name("held object", self.shape, get_args(Shape))
        _check_name("hand", self.hand, get_args(Hand))
        _check_number(f"mass of the held {self.shape}", self.mass, MASSES, "kg")
        what = "length" if self.shape == "stick" else "edge"
        _check_number(f"{what} of the held {self.shape}", self.size, SIZES[self.shape], "m")

    def __str__(self) -> str:
        """The text that `parse_held` reads."""
        return f"{self.shape}:{float(self.mass)!r}kg:{float(self.size)!r}m"

    @property
    def hands(self) -> tuple[str, ...]:
        """The joints of the hands that hold one."""
        sides = ("left", "right") if self.hand == "both" else (self.hand,)
        return tuple(f"{side}_wrist" for side in sides)


def parse_held(text: str, hand: Hand = "right") -> Held:
    """The object of a text such as "stick:2kg" or "block:5kg:0.3m": shape, mass, size.

    Raises InputError for another text.
    """
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise InputError("held object", repr(text), _EXAMPLES, "correct the text")
    shape, mass, mass_unit, size, size_unit = found.groups()
    _check_name("held object", shape, get_args(Shape))
    for number, unit, wanted in ((mass, mass_unit, "kg"), (size, size_unit, "m")):
        if number is not None and unit != wanted:
            raise InputError(
                f"held object {text!r}",
                f"{number} {unit}" if unit else f"{number} without a unit",
                f"{number}{wanted}",
                "give the mass in kg, then, if wanted, the size in m",
            )
    return Held(
        shape,  # type: ignore[arg-type]
        float(mass),
        DEFAULT_SIZE[shape] if size is None else float(size),  # type: ignore[index]
        hand,
    )


def held_parts(held: Held, body: CapsuleBody) -> dict[str, Part]:
    """The object in the T-pose, for each joint of a hand that holds one; named held_left, ..."""
    parts = {}
    for joint in held.hands:
        hand = body.parts[skeleton.INDEX[joint]]
        side = joint.removesuffix("_wrist")
        if held.shape == "stick":
            # Its own z axis forward.
            R = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
            size = np.array([STICK_RADIUS, held.size / 2 - STICK_RADIUS, 0.0])
            below = _half_thickness(hand) + STICK_RADIUS
            center = hand.center - np.array([0.0, 0.0, below])
            solid = Primitive(PREFIX + side, "capsule", size, center, R)
        else:
            out = 1.0 if side == "left" else -1.0
            center = hand.center + np.array([0.0, out * held.size / 2, 0.0])
            size = np.full(3, held.size / 2)
            solid = Primitive(PREFIX + side, "box", size, center, np.eye(3))
        parts[joint] = Part(
            name=solid.name,
            shape=solid.shape,
            size=solid.size,
            center=solid.center,
            R_world_from_part=solid.R_world_from_part,
            mass=held.mass,
            com=solid.center,
            inertia=inertia(solid, held.mass),
        )
    return parts


def _half_thickness(hand: Part) -> float:
    """m, from the middle of the hand to its palm."""
    return float(hand.size[0] if hand.shape == "capsule" else hand.size.min())


def _check_name(place: str, found: str, known: tuple[str, ...]) -> None:
    if found not in known:
        raise InputError(place, repr(found), " or ".join(known), "choose one of these")


def _check_number(place: str, found: float, limits: tuple[float, float], unit: str) -> None:
    if not (math.isfinite(found) and limits[0] <= found <= limits[1]):
        raise InputError(
            place, f"{found:g} {unit}", f"{limits[0]:g} to {limits[1]:g} {unit}", "correct the value"
        )

"""The 50 actuated angles: which axes each of the 22 joints turns about, and in which order.

Knees and toes have one axis, elbows two, the head is welded to the neck (22 SMPL joints with
those reductions leave 53 angles; the paper's 57 coordinates imply one 3-D joint fewer, and the
head is the one that tracks least). Axes are those of the T-pose world: x forward, y left, z up;
the first axis is the outermost. The middle axis of three is the one that small ranges allow:
its angle must stay away from +-90 degrees (gimbal lock).
"""

from __future__ import annotations

from dataclasses import dataclass

from physique import skeleton

#: Axes of each joint, outermost first; "" is welded. The pelvis is free.
AXES: dict[str, str] = {
    "left_hip": "yxz",
    "right_hip": "yxz",
    "spine1": "zxy",
    "left_knee": "y",
    "right_knee": "y",
    "spine2": "zxy",
    "left_ankle": "zxy",
    "right_ankle": "zxy",
    "spine3": "zxy",
    "left_foot": "y",
    "right_foot": "y",
    "neck": "yxz",
    "left_collar": "zxy",
    "right_collar": "zxy",
    "head": "",
    "left_shoulder": "xyz",
    "right_shoulder": "xyz",
    "left_elbow": "yz",
    "right_elbow": "yz",
    "left_wrist": "xzy",
    "right_wrist": "xzy",
}


@dataclass(frozen=True)
class Hinge:
    """One actuated angle: `name` such as "left_knee_y", its joint's name and index, its axis."""

    name: str
    joint: str
    index: int
    axis: str


def _depth_first(index: int = 0) -> list[int]:
    children = [i for i, parent in enumerate(skeleton.PARENTS) if parent == index]
    return [index, *(i for child in children for i in _depth_first(child))]


#: In the order of MuJoCo's coordinates (depth first): angle i is q[7 + i], v[6 + i] and u[i].
HINGES: tuple[Hinge, ...] = tuple(
    Hinge(f"{skeleton.JOINTS[index]}_{axis}", skeleton.JOINTS[index], index, axis)
    for index in _depth_first()
    for axis in AXES.get(skeleton.JOINTS[index], "")
)


def columns(joint: str) -> slice:
    """The columns of `joint` among the 50 angles."""
    found = [i for i, h in enumerate(HINGES) if h.joint == joint]
    return slice(found[0], found[-1] + 1) if found else slice(0, 0)

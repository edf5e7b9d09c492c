"""The 22 body joints of the SMPL model: what every body has and every motion is mapped onto.

World convention: metres; z up, x forward, y left. The rest pose is the T-pose: the person stands
upright on z = 0, faces +x, and holds the arms out along +y (left) and -y (right). At rest every
joint frame is aligned with the world, so a rotation of a joint is "relative to the T-pose".
"""

from __future__ import annotations

JOINTS: tuple[str, ...] = (
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
)

#: Index of each joint's parent; the pelvis has -1.
PARENTS: tuple[int, ...] = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)

INDEX: dict[str, int] = {name: index for index, name in enumerate(JOINTS)}

#: The same joint on the other side of the body; joints on the mid-plane mirror onto themselves.
MIRROR: tuple[int, ...] = tuple(
    INDEX[name.replace("left_", "right_") if name.startswith("left_") else name.replace("right_", "left_")]
    for name in JOINTS
)

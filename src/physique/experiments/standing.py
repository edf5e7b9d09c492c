"""A motion that needs no recording: standing still."""

from __future__ import annotations

import numpy as np

from physique import rotations, skeleton
from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.motion.clip import Motion

FPS = 100.0


def standing(body: str, seconds: float = 0.8, arms: float = 1.2) -> Motion:
    """A ready body that stands upright, with its arms so many rad below the T-pose's."""
    rest = capsule_body(named_body(body)).joints
    turn = np.tile(rotations.IDENTITY, (len(skeleton.JOINTS), 1))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        turn[skeleton.INDEX[f"{side}_shoulder"]] = rotations.about("x", np.array(sign * arms))
    frames = round(seconds * FPS) + 1
    return Motion(
        name="standing",
        source="physique.experiments.standing",
        fps=FPS,
        rotations=np.tile(turn, (frames, 1, 1)),
        root=np.tile(rest[0], (frames, 1)),
        rest_joints=rest,
        contacts=np.ones((frames, 2), dtype=bool),
    )

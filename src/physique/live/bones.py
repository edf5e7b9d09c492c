"""Sending the pose of a skinned mesh to the browsers.

The public way, assigning to `bone.position` and `bone.wxyz`, compares each value with the one
before in NumPy, which takes ten times the processor time of sending it and more than all the rest
of a frame. So the same messages are made here. They belong to viser's inner workings; the
project's requirement names the versions that have them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def send_bones(node: Any, positions: Array, turns: Array) -> None:
    """Move the bones of a skinned mesh to positions (B, 3), m, and turns (B, 4), in its frame."""
    # Imported here: without the extra `view` only serving a page may fail.
    from viser._messages import SetBoneOrientationMessage, SetBonePositionMessage

    send = node._impl.api._queue_scene_message
    for index, (place, turn) in enumerate(zip(positions.tolist(), turns.tolist())):
        send(SetBonePositionMessage(node.name, index, tuple(place)))
        send(SetBoneOrientationMessage(node.name, index, tuple(turn)))

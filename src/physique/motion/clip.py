"""Motion: a clip as it stands in a file, and the same motion on the 22 SMPL joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.rotations import IDENTITY

_MOST_TRACKS = 50_000_000  # joints times frames: 3 GB of rotations and positions


@dataclass(frozen=True)
class Clip:
    """A skeleton and its motion as read from a file: the file's own joints, axes and units.

    name: the file's stem or the library's name. source: the path or origin, for messages.
    joints: J names. parents: (J,) parent index, -1 for the root; parents come before children.
    offsets: (J, 3) rest position of each joint in its parent's frame, file units.
    rotations: (T, J, 4) quaternions wxyz of each joint in its parent's frame.
    positions: (T, J, 3) translation of each joint in its parent's frame (the root's in the world),
        file units; equal to `offsets` but for joints that have position channels.
    fps: frames a second, as the file says.
    unit: metres per file unit, where the format fixes it; None where it must be inferred.
    up: "y" or "z" where the format fixes it; None where it must be inferred.
    """

    name: str
    source: str
    joints: tuple[str, ...]
    parents: NDArray[np.int64]
    offsets: NDArray[np.float64]
    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]
    fps: float
    unit: float | None = None
    up: str | None = None

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.rotations)

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return (self.frames - 1) / self.fps


@dataclass(frozen=True)
class Motion:
    """A motion on the 22 SMPL joints in the world of `physique.skeleton` (metres, z up).

    The floor is z = 0 and the person faces roughly +x in the first frame.
    rotations: (T, 22, 4) wxyz: each joint relative to its parent, identity in the T-pose. The
        pelvis' is its orientation in the world.
    root: (T, 3) m, position of the pelvis joint.
    rest_joints: (22, 3) m, the performer's own joints in the T-pose, soles on z = 0.
    contacts: (T, 2) bool, left and right foot on the floor.
    fps: frames a second.
    """

    name: str
    source: str
    fps: float
    rotations: NDArray[np.float64]
    root: NDArray[np.float64]
    rest_joints: NDArray[np.float64]
    contacts: NDArray[np.bool_]

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.rotations)

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return (self.frames - 1) / self.fps


def rest_tracks(
    source: str, offsets: NDArray[np.float64], frames: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (T, J, 4) and positions (T, J, 3) of a clip that stays at offsets (J, 3).

    Raises InputError, before they are made, for more frames than a computer can hold.
    """
    if len(offsets) * frames > _MOST_TRACKS:
        raise InputError(
            source,
            f"{len(offsets)} joints in {frames} frames",
            f"at most {_MOST_TRACKS:,} joints times frames",
            "cut the recording into parts",
        )
    return np.tile(IDENTITY, (frames, len(offsets), 1)), np.tile(offsets, (frames, 1, 1))

"""From a file or an embedded clip to a motion on the 22 SMPL joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from physique import rotations as rot
from physique.errors import InputError
from physique.motion import ground, rig
from physique.motion.clip import Clip, Motion
from physique.motion.conventions import apply_mapping, read_mapping, recognize
from physique.motion.filter import low_pass as low_pass_filter
from physique.motion.filter import repair_spikes
from physique.motion.library import load_clip
from physique.motion.readers import by_suffix, choose_reader
from physique.motion.tpose import find_tpose


def read_clip(clip: str | Path) -> Clip:
    """The clip in a motion file (of an .amc the .asf lies beside it), or the embedded clip of a name.

    Raises InputError for what is neither, and for damaged files.
    """
    path = Path(clip)
    try:
        exists = path.is_file()
    except OSError:  # a name too long for a file
        exists = False
    if exists:
        return choose_reader(path).read(path)
    if by_suffix(path):
        raise InputError(str(path), "no such file", "a motion file", "check the path")
    return load_clip(str(clip))


def read_motion(
    clip: str | Path | Clip,
    *,
    fps: float | None = None,
    start: float | None = None,
    end: float | None = None,
    mapping: Path | None = None,
    low_pass: float | None = 8.0,
) -> Motion:
    """The motion of a file, an embedded clip or a clip that was read: on the 22 SMPL joints, on the
    floor, facing +x.

    fps: frames a second of the recording, where the file's header is wrong; the frames stay as
        they are. start, end: s, the part to keep. mapping: a TOML file for a skeleton that is
        not recognised (docs/motion.md). low_pass: cut-off in Hz, None for none.

    Raises InputError for input that cannot be used.
    """
    source = clip if isinstance(clip, Clip) else read_clip(clip)
    if fps is not None:
        if not (np.isfinite(fps) and 1 <= fps <= 10000):
            raise InputError("fps", f"{fps:g}", "1 to 10000 frames a second", "correct the value")
        source = replace(source, fps=float(fps))
    if low_pass is not None and not (np.isfinite(low_pass) and low_pass >= 0.1):
        raise InputError(
            "low_pass", f"{low_pass:g}", "a cut-off of 0.1 Hz or more, or None", "correct the value"
        )
    if mapping is None:
        names, joints = recognize(source)
    else:
        names = read_mapping(Path(mapping))
        joints = apply_mapping(names, source)
    tpose = find_tpose(source, names, joints)
    source = replace(
        source, rotations=source.rotations[tpose.lead_in :], positions=source.positions[tpose.lead_in :]
    )
    motion = repair_spikes(rig.to_motion(source, joints, tpose))
    if low_pass is not None:
        motion = low_pass_filter(motion, low_pass)
    # The whole clip shows its floor better than a part does, so trim afterwards.
    return face_forward(trim(ground.settle(motion), start, end))


def trim(motion: Motion, start: float | None = None, end: float | None = None) -> Motion:
    """The part of a motion from `start` to `end`, s.

    Raises InputError where the clip does not have that part.
    """
    if motion.frames < 2:
        raise InputError(
            motion.source, "a single frame", "a motion of two frames or more", "export the whole motion"
        )
    first = 0.0 if start is None else start
    last = motion.seconds if end is None else end
    found = f"start {first:g} s and end {last:g} s"
    if not (0 <= first < last <= motion.seconds + 1.0 / motion.fps):
        expected = f"0 <= start < end <= {motion.seconds:.2f} s"
        raise InputError(motion.source, found, expected, "correct them")
    keep = slice(round(first * motion.fps), min(round(last * motion.fps) + 1, motion.frames))
    if keep.stop - keep.start < 2:
        expected = f"a part of at least two frames, {1.0 / motion.fps:.2g} s"
        raise InputError(motion.source, found, expected, "move them apart")
    return replace(
        motion, rotations=motion.rotations[keep], root=motion.root[keep], contacts=motion.contacts[keep]
    )


def face_forward(motion: Motion) -> Motion:
    """The motion turned and moved so that it starts over the origin, the pelvis facing +x."""
    left = rot.rotate(motion.rotations[0, 0], np.array([0.0, 1.0, 0.0]))
    forward = np.array([left[1], -left[0]])  # left x up: a stoop or a lean back does not turn it
    if np.hypot(*forward) < 0.3:  # lying on the side
        forward = rot.rotate(motion.rotations[0, 0], np.array([0.0, 0.0, 1.0]))[:2]
    turn = rot.about("z", -np.arctan2(forward[1], forward[0]))
    rotations = motion.rotations.copy()
    rotations[:, 0] = rot.normalize(rot.multiply(turn, rotations[:, 0]))
    root = rot.rotate(turn, motion.root - motion.root[0] * np.array([1.0, 1.0, 0.0]))
    return replace(motion, rotations=rotations, root=root)

"""Acclaim files: the skeleton in an .asf, the motion in an .amc."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.clip import Clip

Array = NDArray[np.float64]
INCH = 0.0254
_CHANNELS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")


@dataclass
class _Bone:
    """One bone of the .asf: its rest direction in the world, its axis frame and its channels."""

    name: str
    direction: tuple[float, ...] = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: Array | None = None  # (4,) world from the frame in which the channels turn
    dof: tuple[str, ...] = ()
    parent: int = -1


@dataclass
class _Skeleton:
    bones: list[_Bone]
    meters: float
    degrees: bool


def find_asf(amc: Path) -> Path:
    """The .asf of an .amc: beside it, with the same stem, the stem before "_", or the only one.

    Raises InputError where there is none or more than one to choose from.
    """
    if not amc.is_file():
        raise InputError(str(amc), "no such file", "an .amc file", "check the path")
    beside = sorted(path for path in amc.parent.iterdir() if path.suffix.lower() == ".asf")
    for stem in (amc.stem, amc.stem.split("_")[0]):
        for path in beside:
            if path.stem == stem:
                return path
    if len(beside) == 1:
        return beside[0]
    found = f"{len(beside)} .asf files, none of that name" if beside else "no .asf file beside it"
    raise InputError(
        str(amc),
        found,
        f"{amc.stem.split('_')[0]}.asf in the same folder",
        "put the subject's .asf file there",
    )


def read_asfamc(amc: Path, asf: Path | None = None) -> Clip:
    """The clip in an .amc file (120 frames a second, as CMU's; the format holds no rate).

    Joints are named after the bones, and stand where the bones begin; lengths are in inches over
    the file's `length` unit, which fixes metres: CMU's 0.45 gives 0.0564 m. y is up.

    Raises InputError naming the line for damaged or incomplete files.
    """
    skeleton_path = asf or find_asf(amc)
    skeleton = _read_asf(skeleton_path)
    rows = _read_amc(amc, skeleton)  # one (T, dof) array a bone
    bones = skeleton.bones
    frames = len(rows[0])
    offsets = np.zeros((len(bones), 3))
    for j, bone in enumerate(bones):
        if bone.parent >= 0:
            up = bones[bone.parent]
            offsets[j] = np.array(up.direction) * up.length
    rotations = np.tile(rot.IDENTITY, (frames, len(bones), 1))
    positions = np.tile(offsets, (frames, 1, 1))
    for j, bone in enumerate(bones):
        turns = [i for i, channel in enumerate(bone.dof) if channel[0] == "r"]
        if turns:
            # Acclaim multiplies in the listed order: the first channel turns first.
            order = "".join(bone.dof[i][1] for i in reversed(turns))
            angles = rows[j][:, list(reversed(turns))]
            angles = np.radians(angles) if skeleton.degrees else angles
            turn = rot.from_euler(order, angles)
            axis = bone.axis if bone.axis is not None else rot.IDENTITY
            turn = rot.multiply(rot.multiply(axis, turn), rot.conjugate(axis))
            rotations[:, j] = rot.positive(turn)
        for i, channel in enumerate(bone.dof):
            if channel[0] == "t":
                positions[:, j, "xyz".index(channel[1])] += rows[j][:, i]
    return Clip(
        name=amc.stem,
        source=str(amc),
        joints=tuple(bone.name for bone in bones),
        parents=np.array([bone.parent for bone in bones], dtype=np.int64),
        offsets=offsets,
        rotations=rotations,
        positions=positions,
        fps=120.0,
        unit=skeleton.meters,
        up="y",
    )


def _read_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers from 1 and words, without comments and blank lines."""
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(
            str(path),
            error.strerror or "an unreadable file",
            "an Acclaim file",
            "check the path and its permissions",
        ) from error
    lines = [(i, line.split("#")[0].split()) for i, line in enumerate(text.splitlines(), start=1)]
    return [(number, words) for number, words in lines if words]


def _floats(words: list[str], place: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InputError(
            place, f"{' '.join(words)[:60]!r}", "numbers", "correct the line or copy the file anew"
        ) from error
    if not np.all(np.abs(values) < 1e9):  # nan is not
        raise InputError(
            place,
            f"{' '.join(words)[:60]!r}",
            "finite numbers below 1e9",
            "repair the value or copy the file anew",
        )
    return values


def _read_asf(path: Path) -> _Skeleton:
    bones = [_Bone("root", axis=rot.IDENTITY, dof=("tx", "ty", "tz", "rx", "ry", "rz"))]
    index = {"root": 0}
    length, degrees, section = 1.0, True, ""
    bone: _Bone | None = None
    linked = {0}
    for number, words in _read_lines(path):
        place = f"{path}, line {number}"
        key = words[0].lower()
        if key.startswith(":"):
            section = key
        elif section == ":units" and key == "length":
            length = _floats(words[1:2], place)[0]
        elif section == ":units" and key == "angle":
            degrees = words[1].lower().startswith("deg")
        elif section == ":root" and key == "order":
            bones[0].dof = _channels(words[1:], place)
        elif section == ":root" and key == "axis":
            if words[1].upper() != "XYZ":
                raise InputError(place, f"root axis {words[1]}", "XYZ", "convert the file")
        elif section == ":root" and key in ("position", "orientation"):
            if any(_floats(words[1:4], place)):
                raise InputError(place, f"a root {key} that is not zero", "0 0 0", "convert the file")
        elif section == ":bonedata" and key == "begin":
            bone = _Bone("")
        elif section == ":bonedata" and key == "end" and bone is not None:
            if not bone.name or bone.name in index:
                raise InputError(
                    place,
                    f"bone name {bone.name!r} missing or twice",
                    "a different name for every bone",
                    "rename the bone",
                )
            index[bone.name] = len(bones)
            bones.append(bone)
            bone = None
        elif section == ":bonedata" and bone is not None:
            if key == "name":
                bone.name = words[1]
            elif key == "direction":
                bone.direction = tuple(_floats(words[1:4], place))
            elif key == "length":
                bone.length = _floats(words[1:2], place)[0]
            elif key == "axis":
                order = words[4].lower() if len(words) > 4 else "xyz"
                angles = np.array(_floats(words[1:4], place))
                angles = np.radians(angles) if degrees else angles
                # The first named axis turns first, so the last is the outermost.
                bone.axis = rot.from_euler(order[::-1], angles[::-1])
            elif key == "dof":
                bone.dof = _channels(words[1:], place)
        elif section == ":hierarchy" and key not in ("begin", "end"):
            for word in words:
                if word not in index:
                    raise InputError(place, f"bone {word!r}", "a bone of :bonedata", "correct the hierarchy")
            for word in words[1:]:
                bones[index[word]].parent = index[words[0]]
                linked.add(index[word])
    if len(bones) == 1 or len(linked) < len(bones):
        loose = [b.name for i, b in enumerate(bones) if i not in linked]
        found = f"bones outside the hierarchy: {', '.join(loose[:5])}" if loose else "no bones"
        raise InputError(
            str(path),
            found,
            "an Acclaim skeleton with :bonedata and :hierarchy",
            "check that the file is complete",
        )
    if not length > 0:
        raise InputError(
            str(path), f"length unit {length:g}", "a positive number", "correct the :units section"
        )
    return _Skeleton(_parents_first(bones, path), INCH / length, degrees)


def _channels(words: list[str], place: str) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in words)
    if bad := [channel for channel in channels if channel not in _CHANNELS]:
        raise InputError(place, f"channel {bad[0]!r}", "tx ty tz rx ry rz", "correct the line")
    return channels


def _parents_first(bones: list[_Bone], path: Path) -> list[_Bone]:
    """The bones in an order in which parents precede children."""
    order: list[int] = [0]
    for i in order:  # grows while it is walked
        order += [j for j, bone in enumerate(bones) if bone.parent == i and j not in order]
    if len(order) != len(bones):
        raise InputError(
            str(path),
            "a hierarchy that is not a tree",
            "one parent for every bone",
            "correct the :hierarchy section",
        )
    new = {old: i for i, old in enumerate(order)}
    for bone in bones:
        bone.parent = new.get(bone.parent, -1)
    return [bones[i] for i in order]


def _read_amc(path: Path, skeleton: _Skeleton) -> list[Array]:
    bones = {bone.name: bone for bone in skeleton.bones}
    needed = {bone.name for bone in skeleton.bones if bone.dof}
    frames: list[dict[str, list[float]]] = []
    for number, words in _read_lines(path):
        place = f"{path}, line {number}"
        if words[0].startswith(":"):
            if words[0].upper() == ":RADIANS":
                skeleton.degrees = False
        elif len(words) == 1 and words[0].isdigit():
            _check_complete(path, frames, needed)
            frames.append({})
        elif not frames:
            raise InputError(
                place, f"{words[0]!r}", "a frame number first", "check that this is an .amc file"
            )
        else:
            bone = bones.get(words[0])
            if bone is None or words[0] in frames[-1]:
                raise InputError(
                    place,
                    f"bone {words[0]!r} in frame {len(frames)}",
                    "each bone of the .asf once a frame",
                    "check that the .asf and .amc belong together",
                )
            values = _floats(words[1:], place)
            if len(values) != len(bone.dof):
                raise InputError(
                    place,
                    f"{len(values)} values for {bone.name!r}",
                    f"{len(bone.dof)}, as its dof line in the .asf",
                    "the file is cut off or damaged: copy it anew",
                )
            frames[-1][words[0]] = values
    if not frames:
        raise InputError(
            str(path), "no frames", "an .amc file with one frame or more", "check that the file is complete"
        )
    _check_complete(path, frames, needed)
    return [
        np.array([f[bone.name] for f in frames]) if bone.dof else np.zeros((len(frames), 0))
        for bone in skeleton.bones
    ]


def _check_complete(path: Path, frames: list[dict[str, list[float]]], needed: set[str]) -> None:
    if frames and (missing := needed - frames[-1].keys()):
        raise InputError(
            f"{path}, frame {len(frames)}",
            f"no values for {sorted(missing)[0]!r}",
            "every bone in every frame",
            "the file is cut off or damaged: copy it anew",
        )

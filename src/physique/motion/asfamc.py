"""Acclaim files: the skeleton in an .asf, the motion in an .amc."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.clip import Clip, rest_tracks
from physique.motion.reader import Reader
from physique.motion.text import Line, first_words, joined, read_lines, shown, unreadable

Array = NDArray[np.float64]
INCH = 0.0254
_CHANNELS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_ASF_SECTIONS = (":version", ":name", ":units", ":documentation", ":root", ":bonedata", ":hierarchy", ":skin")


@dataclass
class _Bone:
    """One bone of the .asf: its rest direction in the world, its axis frame and its channels."""

    name: str
    direction: Array
    length: float = 0.0
    axis: Array | None = None  # (4,) world from the frame in which the channels turn
    dof: tuple[str, ...] = ()
    parent: int = -1


@dataclass(frozen=True)
class _Skeleton:
    """Bones, parents before children; metres a unit; whether angles are in degrees."""

    bones: list[_Bone]
    meters: float
    degrees: bool


def find_asf(amc: Path) -> Path:
    """The .asf of an .amc: beside it, with the same stem or the longest part of it before a "_",
    or the only one.

    Raises InputError where there is none or more than one to choose from.
    """
    if not amc.is_file():
        raise InputError(str(amc), "no such file", "an .amc file", "check the path")
    try:
        beside = sorted(path for path in amc.parent.iterdir() if path.suffix.lower() == ".asf")
    except OSError as error:
        raise unreadable(amc.parent, error, "a folder with an .asf file") from error
    parts = amc.stem.split("_")
    for stem in ("_".join(parts[:n]) for n in range(len(parts), 0, -1)):
        for path in beside:
            if path.stem == stem:
                return path
    if len(beside) == 1:
        return beside[0]
    found = f"{len(beside)} .asf files, none of that name" if beside else "no .asf file beside it"
    raise InputError(
        str(amc), found, f"{parts[0]}.asf in the same folder", "put the subject's .asf file there"
    )


def read_asfamc(amc: Path, asf: Path | None = None) -> Clip:
    """The clip in an .amc file (120 frames a second, as CMU's; the format holds no rate).

    Joints are named after the bones, and stand where the bones begin; lengths are in inches over
    the file's `length` unit, which fixes metres: CMU's 0.45 gives 0.0564 m. y is up.

    Raises InputError naming the line for damaged or incomplete files.
    """
    lines = read_lines(amc, "an .amc file", comment="#")
    if lines and lines[0].key in _ASF_SECTIONS:
        raise InputError(
            str(amc), "a skeleton without a motion", "an .amc file", "name the .amc of the motion"
        )
    skeleton = _read_asf(asf or find_asf(amc))
    rows, degrees = _read_amc(amc, lines, skeleton)
    bones = skeleton.bones
    offsets = np.zeros((len(bones), 3))
    for j, bone in enumerate(bones):
        if bone.parent >= 0:
            offsets[j] = bones[bone.parent].direction * bones[bone.parent].length
    rotations, positions = rest_tracks(str(amc), offsets, len(rows[0]))
    for j, bone in enumerate(bones):
        turns = [i for i, channel in enumerate(bone.dof) if channel[0] == "r"]
        if turns:
            # Acclaim multiplies in the listed order: the first channel turns first.
            order = "".join(bone.dof[i][1] for i in reversed(turns))
            angles = rows[j][:, list(reversed(turns))]
            turn = rot.from_euler(order, np.radians(angles) if degrees else angles)
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


def _read_asf(path: Path) -> _Skeleton:
    sections: dict[str, list[Line]] = {"": []}
    section = ""
    for line in read_lines(path, "an .asf file", comment="#"):
        if line.key.startswith(":"):
            section = line.key
            sections.setdefault(section, [])
        else:
            sections[section].append(line)
    length, degrees = _read_units(sections.get(":units", []))
    bones = [_read_root(sections.get(":root", []))]
    bones += _read_bones(sections.get(":bonedata", []), degrees)
    linked = _link(bones, sections.get(":hierarchy", []))
    if len(bones) == 1 or not all(linked):
        loose = [bone.name for bone, link in zip(bones, linked, strict=True) if not link]
        raise InputError(
            str(path),
            f"bones outside the hierarchy: {joined(loose, 5)}" if loose else "no bones",
            "an Acclaim skeleton with :bonedata and :hierarchy",
            "check that the file is complete",
        )
    return _Skeleton(_parents_first(bones, path), INCH / length, degrees)


def _read_units(lines: list[Line]) -> tuple[float, bool]:
    """The length unit, and whether angles are in degrees."""
    length, degrees = 1.0, True
    for line in lines:
        if line.key == "length":
            length = line.numbers(1, "length", 1)[0]
            if not 1e-6 < length < 1e6:
                raise line.error(f"length unit {length:g}", "a positive number, such as 0.45")
        elif line.key == "angle":
            degrees = line.word(1, "deg or rad").lower().startswith("deg")
    return length, degrees


def _read_root(lines: list[Line]) -> _Bone:
    root = _Bone("root", np.zeros(3), axis=rot.IDENTITY, dof=("tx", "ty", "tz", "rx", "ry", "rz"))
    for line in lines:
        if line.key == "order":
            root.dof = _channels(line)
        elif line.key == "axis" and line.word(1, "XYZ").upper() != "XYZ":
            raise line.error(f"root axis {shown(line.words[1])}", "XYZ", "export it with that axis order")
        elif line.key in ("position", "orientation") and any(line.numbers(1, line.key, 3)):
            remedy = "write zeros there, if the root may move so, or export the file anew"
            raise line.error(f"a root {line.key} that is not zero", "0 0 0", remedy)
    return root


def _read_bones(lines: list[Line], degrees: bool) -> list[_Bone]:
    bones: list[_Bone] = []
    names = {"root"}
    bone: _Bone | None = None
    for line in lines:
        if line.key == "begin":
            if bone is not None:
                raise line.error("'begin' inside a bone", "'end' first")
            bone = _Bone("", np.zeros(3))
        elif bone is None:
            raise line.error(f"{shown(line.words[0])} outside a bone", "'begin'")
        elif line.key == "name":
            bone.name = line.word(1, "the bone's name")
        elif line.key == "direction":
            bone.direction = np.array(line.numbers(1, "direction", 3))
        elif line.key == "length":
            bone.length = line.numbers(1, "length", 1)[0]
        elif line.key == "axis":
            bone.axis = _axis(line, degrees)
        elif line.key == "dof":
            bone.dof = _channels(line)
        elif line.key == "end":
            if not bone.name or bone.name in names:
                raise line.error(
                    f"bone name {shown(bone.name)} missing or twice",
                    "a different name for every bone",
                    "rename it",
                )
            names.add(bone.name)
            bones.append(bone)
            bone = None
    if bone is not None:
        raise lines[-1].error(f"bone {shown(bone.name)} without an end", "'end' after each bone")
    return bones


def _axis(line: Line, degrees: bool) -> Array:
    """(4,) world from the bone's frame, of "axis 0 0 90 XYZ"."""
    order = line.words[4].lower() if len(line.words) > 4 else "xyz"
    if sorted(order) != ["x", "y", "z"]:
        raise line.error(f"axis order {shown(order)}", "XYZ in any order")
    angles = np.array(Line(line.path, line.number, line.words[:4]).numbers(1, "axis", 3))
    # The first named axis turns first, so the last is the outermost.
    return rot.from_euler(order[::-1], (np.radians(angles) if degrees else angles)[::-1])


def _channels(line: Line) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in line.words[1:])
    if bad := [c for c in channels if c not in _CHANNELS or channels.count(c) > 1]:
        raise line.error(f"channel {shown(bad[0])}", "tx ty tz rx ry rz l, each once")
    return channels


def _link(bones: list[_Bone], lines: list[Line]) -> list[bool]:
    """Set each bone's parent; which bones have one, or are the root."""
    index = {bone.name: i for i, bone in enumerate(bones)}
    linked = [i == 0 for i in range(len(bones))]
    for line in lines:
        if line.key in ("begin", "end"):
            continue
        for word in line.words:
            if word not in index:
                raise line.error(f"bone {shown(word)}", "a bone of :bonedata", "correct the hierarchy")
        for child in (index[word] for word in line.words[1:]):
            if linked[child]:
                raise line.error(
                    f"bone {shown(bones[child].name)} below a second bone",
                    "one parent for every bone, none for the root",
                    "correct the hierarchy",
                )
            bones[child].parent, linked[child] = index[line.words[0]], True
    return linked


def _parents_first(bones: list[_Bone], path: Path) -> list[_Bone]:
    """The bones in an order in which parents precede children."""
    children: list[list[int]] = [[] for _ in bones]
    for i, bone in enumerate(bones[1:], start=1):
        children[bone.parent].append(i)
    order = [0]
    for i in order:  # grows while it is walked
        order += children[i]
    if len(order) != len(bones):
        loose = joined([bone.name for i, bone in enumerate(bones) if i not in order], 5)
        raise InputError(
            str(path),
            f"bones that are their own ancestors: {loose}",
            "a tree",
            "correct the :hierarchy section",
        )
    new = {old: i for i, old in enumerate(order)}
    for bone in bones:
        bone.parent = new.get(bone.parent, -1)
    return [bones[i] for i in order]


def _read_amc(path: Path, lines: list[Line], skeleton: _Skeleton) -> tuple[list[Array], bool]:
    """One (T, dof) array a bone, and whether the angles in them are in degrees."""
    bones = {bone.name: bone for bone in skeleton.bones}
    needed = {bone.name for bone in skeleton.bones if bone.dof}
    degrees = skeleton.degrees
    frames: list[dict[str, list[float]]] = []
    for line in lines:
        name = line.words[0]
        if name.startswith(":"):
            degrees = degrees and line.key != ":radians"
        elif len(line.words) == 1 and name.isdigit():
            _check_complete(path, frames, needed)
            frames.append({})
        elif not frames:
            raise line.error(f"{shown(name)}", "a frame number first", "check that this is an .amc file")
        else:
            bone = bones.get(name)
            if bone is None or name in frames[-1]:
                raise line.error(
                    f"bone {shown(name)} in frame {len(frames)}",
                    "each bone of the .asf once a frame",
                    "check that the .asf and .amc belong together",
                )
            values = line.numbers(1, shown(name))
            if len(values) != len(bone.dof):
                raise line.error(
                    f"{len(values)} values for {shown(name)}", f"{len(bone.dof)}, as its dof line in the .asf"
                )
            frames[-1][name] = values
    if not frames:
        raise InputError(
            str(path), "no frames", "an .amc file with one frame or more", "check that the file is complete"
        )
    _check_complete(path, frames, needed)
    rows = [
        np.array([f[bone.name] for f in frames]) if bone.dof else np.zeros((len(frames), 0))
        for bone in skeleton.bones
    ]
    return rows, degrees


def _check_complete(path: Path, frames: list[dict[str, list[float]]], needed: set[str]) -> None:
    if frames and (missing := needed - frames[-1].keys()):
        raise InputError(
            f"{path}, frame {len(frames)}",
            f"no values for {shown(sorted(missing)[0])}",
            "every bone in every frame",
            "the file is cut off or damaged: copy it anew",
        )


def _recognises(head: bytes, path: Path) -> bool:
    """A section's name or a frame number first; of an .asf too, of which `read_asfamc` says more."""
    words = [*first_words(head, 2), "", ""]
    return words[0].startswith(":") or (words[0].isdigit() and words[1] == "root")


READER = Reader("Acclaim", (".amc",), _recognises, read_asfamc)

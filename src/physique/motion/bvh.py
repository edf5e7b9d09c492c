"""BVH files: a text hierarchy and a row of channel values for each frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot
from physique.errors import InputError
from physique.motion.clip import Clip, rest_tracks
from physique.motion.reader import Reader
from physique.motion.text import LARGEST, Line, first_words, read_lines, shown

Array = NDArray[np.float64]

_FIX = "correct the hierarchy"


@dataclass
class _Node:
    """One joint while the hierarchy is being read; `columns` are its places in a frame's row."""

    name: str
    parent: int
    line: Line
    offset: list[float] | None = None
    rotation_axes: str = ""
    rotation_columns: list[int] = field(default_factory=list)
    position_axes: str = ""
    position_columns: list[int] = field(default_factory=list)
    ends: int = 0  # end sites that hang on it


def read_bvh(path: Path) -> Clip:
    """The clip in a BVH file.

    Every joint may have position channels and none to three rotation channels, in any order; end
    sites become joints named "<parent> end". Keywords may be in either case, braces and the values
    of a frame on any number of lines.

    Raises InputError, naming the line, for anything that is not a complete BVH file: missing
    sections, unbalanced braces, duplicate joint names, frames of a wrong length, a number of frames
    that differs from "Frames:", values that are not finite, a frame time that is not positive.
    """
    lines = read_lines(path, "a BVH file")
    nodes, channels, row = _read_hierarchy(lines)
    frame_count, frame_time, row = _read_motion_header(lines, row)
    values = _read_rows(lines[row:], frame_count, channels, path)
    return _to_clip(nodes, values, 1.0 / frame_time, path)


class _Hierarchy:
    """The joints read so far, in file order, and which of them are open."""

    def __init__(self) -> None:
        self.nodes: list[_Node] = []
        self.channels = 0
        self._names: set[str] = set()
        self._open: list[int] = []
        self._pending: int | None = None  # the joint whose "{" has not come yet

    def read(self, line: Line) -> None:
        """Take in a line that holds braces or else one keyword."""
        if line.key in ("root", "joint", "end"):
            self._add_joint(line)
        elif line.key == "{":
            if self._pending is None:
                raise line.error("'{' without a joint", "JOINT before '{'", _FIX)
            self._open.append(self._pending)
            self._pending = None
        elif line.key == "}":
            if not self._open:
                raise line.error("'}' too many", "a '{' for every '}'", _FIX)
            self._open.pop()
        elif line.key in ("offset", "channels"):
            keyword = line.key.upper()
            if not self._open or self._pending is not None:
                raise line.error(f"{keyword} outside a joint", f"{keyword} after '{{'", _FIX)
            node = self.nodes[self._open[-1]]
            if keyword == "OFFSET":
                node.offset = line.numbers(1, "OFFSET", 3)
            else:
                self._add_channels(node, line)
        elif line.key != "hierarchy":
            raise line.error(
                shown(" ".join(line.words)),
                "HIERARCHY, ROOT, JOINT, OFFSET, CHANNELS, End Site or MOTION",
                "check that this is a BVH file",
            )

    def close(self, motion: Line) -> None:
        """Check that the hierarchy is complete where the line "MOTION" comes."""
        if self._open or self._pending is not None:
            raise motion.error("MOTION inside an open '{'", "a '}' for every '{'", _FIX)
        for node in self.nodes:
            if node.offset is None:
                raise node.line.error(f"joint {shown(node.name)} without OFFSET", "an OFFSET line")

    def _add_joint(self, line: Line) -> None:
        parent = self._open[-1] if self._open else -1
        if line.key == "root" and self.nodes:
            raise line.error("a second ROOT", "one skeleton a file", "split the file, one skeleton in each")
        if line.key != "root" and parent < 0:
            raise line.error(f"{line.words[0]} outside ROOT", "ROOT first", _FIX)
        if self._pending is not None:
            raise line.error(f"{line.words[0]} before '{{'", "'{' after a joint's name", _FIX)
        name = " ".join(line.words[1:])
        if line.key == "end":
            above = self.nodes[parent]
            above.ends += 1
            name = f"{above.name} end" if above.ends == 1 else f"{above.name} end {above.ends}"
        if not name or name in self._names:
            found = f"the joint name {shown(name)} twice" if name else "no name"
            raise line.error(found, "a different name for every joint", "rename the joint")
        self._names.add(name)
        self._pending = len(self.nodes)
        self.nodes.append(_Node(name, parent, line))

    def _add_channels(self, node: _Node, line: Line) -> None:
        names = line.words[2:]
        if line.count(1, "a number of channels") != len(names):
            raise line.error(shown(" ".join(line.words)), "CHANNELS, a count, that many names")
        for column, name in enumerate(names, start=self.channels):
            axis, kind = name[:1].lower(), name[1:].lower()
            if axis not in ("x", "y", "z") or kind not in ("position", "rotation"):
                raise line.error(f"channel {shown(name)}", "Xposition, ... or Xrotation, ...")
            if axis in (node.position_axes if kind == "position" else node.rotation_axes):
                raise line.error(f"channel {name!r} twice", "each channel once")
            if kind == "position":
                node.position_axes += axis
                node.position_columns.append(column)
            else:
                node.rotation_axes += axis
                node.rotation_columns.append(column)
        self.channels += len(names)


def _read_hierarchy(lines: list[Line]) -> tuple[list[_Node], int, int]:
    """Joints in file order, the number of channels, and the index of the line after "MOTION"."""
    hierarchy = _Hierarchy()
    for index, line in enumerate(lines):
        if line.key == "motion" and hierarchy.nodes:
            hierarchy.close(line)
            return hierarchy.nodes, hierarchy.channels, index + 1
        for piece in _pieces(line):
            hierarchy.read(piece)
    missing = "MOTION section" if hierarchy.nodes else "ROOT joint"
    raise lines[-1].error(f"no {missing}", "HIERARCHY, then MOTION", "check that the file is complete")


def _pieces(line: Line) -> Iterator[Line]:
    """The line cut at its braces: exporters put them on lines of their own, or do not."""
    words: list[str] = []
    for word in [*" ".join(line.words).replace("{", " { ").replace("}", " } ").split(), ""]:
        if word not in ("{", "}", ""):
            words.append(word)
            continue
        for piece in (words, [word] if word else []):
            if piece:
                yield Line(line.path, line.number, tuple(piece))
        words = []


def _read_motion_header(lines: list[Line], row: int) -> tuple[int, float, int]:
    """Frame count, seconds a frame, and the index of the first row."""
    found: dict[str, Line] = {}
    while row < len(lines) and len(found) < 2:
        line = lines[row]
        key, colon, value = " ".join(line.words).partition(":")
        if not colon or key.lower() not in ("frames", "frame time"):
            break
        found[key.lower()] = Line(line.path, line.number, (key, *value.split()))
        row += 1
    for key in ("frames", "frame time"):
        if key not in found:
            raise lines[min(row, len(lines) - 1)].error(
                f"no '{key.title()}:' line",
                "'Frames:' and 'Frame Time:' after MOTION",
                "check that the file is complete",
            )
    count = found["frames"].count(1, "a count of 1 or more after Frames:")
    if count == 0:
        raise found["frames"].error("Frames: 0", "a count of 1 or more")
    line = found["frame time"]
    line = Line(line.path, line.number, tuple(word.replace(",", ".") for word in line.words))
    frame_time = line.numbers(1, "Frame Time", 1)[0]
    if not 1e-4 <= frame_time <= 2.0:
        raise line.error(
            f"Frame Time: {frame_time:g}",
            "0.0001 to 2 seconds",
            "correct the line (120 frames a second: 0.0083333)",
        )
    return count, frame_time, row


def _read_rows(lines: list[Line], count: int, channels: int, path: Path) -> Array:
    """(count, channels) values; angles in degrees, as in the file.

    A frame may run over several lines, but each begins on a new one.
    """
    rows: list[Array] = []
    first: Line | None = None  # of a frame that is not complete yet
    parts: list[Array] = []
    for line in lines:
        first = first or line
        parts.append(_values(line, f"frame {len(rows)}"))
        size = sum(map(len, parts))
        if size > channels:
            break
        if size == channels:
            rows.append(parts[0] if len(parts) == 1 else np.concatenate(parts))
            first, parts = None, []
    if first is not None:
        raise first.error(
            f"{len(first.words)} values in frame {len(rows)}",
            f"{channels}, as the hierarchy has channels, or lines that add up to them",
        )
    if len(rows) != count:
        raise InputError(
            str(path),
            f"{len(rows)} rows of values",
            f"Frames: {count}",
            f"copy it anew, or write 'Frames: {len(rows)}'",
        )
    return np.stack(rows)


def _values(line: Line, what: str) -> Array:
    """The numbers of a line, all at once where they are good, else one by one to find the fault."""
    try:
        values = np.array(line.words, dtype=np.float64)
    except ValueError:
        return np.array(line.numbers(0, what))
    return values if (np.abs(values) < LARGEST).all() else np.array(line.numbers(0, what))


def _to_clip(nodes: list[_Node], values: Array, fps: float, path: Path) -> Clip:
    offsets = np.array([node.offset for node in nodes], dtype=np.float64)
    rotations, positions = rest_tracks(str(path), offsets, len(values))
    for j, node in enumerate(nodes):
        if node.rotation_columns:
            angles = np.radians(values[:, node.rotation_columns])
            rotations[:, j] = rot.positive(rot.from_euler(node.rotation_axes, angles))
        if node.position_columns:
            axes = ["xyz".index(axis) for axis in node.position_axes]
            moved = values[:, node.position_columns]
            # Exporters differ: most write positions that replace OFFSET, some (iClone) write
            # what is added to it. The values themselves tell, where OFFSET is not zero.
            offset = offsets[j, axes]
            along = float(np.median(moved @ offset))
            added = along < 0.5 * float(offset @ offset)
            positions[:, j, axes] = moved + offset if added else moved
    return Clip(
        name=path.stem,
        source=str(path),
        joints=tuple(node.name for node in nodes),
        parents=np.array([node.parent for node in nodes], dtype=np.int64),
        offsets=offsets,
        rotations=rotations,
        positions=positions,
        fps=_whole_rate(fps),
    )


def _whole_rate(fps: float) -> float:
    """The rate, rounded where the file's few digits meant a whole number: 120.00048 is 120."""
    whole = round(fps)
    return float(whole) if whole and abs(fps - whole) < 2e-4 * fps else fps


def _recognises(head: bytes, path: Path) -> bool:
    return first_words(head, 1) == ["hierarchy"]


READER = Reader("BVH", (".bvh",), _recognises, read_bvh)

"""Which of a file's joints is which: the known naming conventions and users' mapping files."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

from physique.errors import InputError
from physique.motion.clip import Clip
from physique.motion.text import decode, joined, shown, unreadable

_SIDED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
REQUIRED: tuple[str, ...] = (
    "pelvis",
    "spine",
    *(f"{side}_{part}" for part in _SIDED for side in ("left", "right")),
)
OPTIONAL: tuple[str, ...] = ("neck", "head", "left_collar", "right_collar", "left_foot", "right_foot")
_SETTINGS = ("units", "unit", "up", "tpose", "joints")
_PREFIX = re.compile(r"^(mixamorig\d*|cc base|character\d*|bip\d*|biped|def|rig)[ :]+(?=.)")


@dataclass(frozen=True)
class Mapping:
    """How a skeleton's joints map onto the 22 SMPL joints.

    name: of the convention or the mapping file.
    joints: for each body joint ("pelvis", "spine", "left_hip", ...) the chain of file joints, from
        the root outwards, that together make it: it stands where the first stands and turns as
        the last turns.
    units: metres per file unit that the convention may use, besides the usual ones.
    unit: metres per file unit, where the mapping file says so.
    up: "y" or "z", where the mapping file says so.
    tpose: "auto", "offsets" (all rotations zero), or the number of the frame that is a T-pose.
    """

    name: str
    joints: dict[str, tuple[str, ...]]
    units: tuple[float, ...] = ()
    unit: float | None = None
    up: str | None = None
    tpose: str | int = "auto"


def read_mapping(path: Path) -> Mapping:
    """The mapping in a TOML file (see docs/motion.md).

    Raises InputError for a file that is not TOML or has unknown keys or values.
    """
    try:
        table = tomllib.loads(decode(path.read_bytes()))
    except OSError as error:
        raise unreadable(path, error, "a mapping file") from error
    except (ValueError, RecursionError) as error:  # also of numbers too long and brackets too deep
        raise InputError(
            str(path), f"text that is not TOML ({error})", "a mapping file", "correct the line"
        ) from error
    return _parse(table, path.stem, str(path))


def _parse(table: dict[str, Any], name: str, place: str) -> Mapping:
    if unknown := [key for key in table if key not in _SETTINGS]:
        raise InputError(
            place, f"the key {shown(unknown[0])}", f"one of {', '.join(_SETTINGS)}", "correct the key"
        )
    joints = table.get("joints")
    if not isinstance(joints, dict):
        raise InputError(
            place, "no [joints] table", "[joints] with a line for each body joint", "add the table"
        )
    chains: dict[str, tuple[str, ...]] = {}
    for key, value in joints.items():
        if key not in REQUIRED + OPTIONAL:
            raise InputError(
                place,
                f"the body joint {shown(key)}",
                f"one of {', '.join(REQUIRED + OPTIONAL)}",
                "correct the name",
            )
        chain = [value] if isinstance(value, str) else value
        if not isinstance(chain, list) or not chain or not all(isinstance(c, str) for c in chain):
            raise InputError(
                place, f"{key} = {shown(value)}", "a joint name or a list of them", "put the names in quotes"
            )
        chains[key] = tuple(chain)
    if missing := [key for key in REQUIRED if key not in chains]:
        raise InputError(
            place,
            f"no line for {', '.join(missing)}",
            f"at least {', '.join(REQUIRED)}",
            "add them under [joints]",
        )
    unit, units = table.get("unit"), table.get("units", [])
    units = units if isinstance(units, list) else [units]
    for value in [*([] if unit is None else [unit]), *units]:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < 1e3:
            raise InputError(
                place, f"the unit {shown(value)}", "metres per file unit, such as 0.01", "correct the value"
            )
    if table.get("up") not in (None, "y", "z"):
        raise InputError(place, f"up = {shown(table['up'])}", 'up = "y" or up = "z"', "correct it")
    tpose = table.get("tpose", "auto")
    if isinstance(tpose, bool) or not (
        tpose in ("auto", "offsets") or (isinstance(tpose, int) and tpose >= 0)
    ):
        raise InputError(
            place, f"tpose = {shown(tpose)}", '"auto", "offsets" or a frame number from 0', "correct it"
        )
    return Mapping(name, chains, tuple(units), unit, table.get("up"), tpose)


@cache
def known_conventions() -> tuple[Mapping, ...]:
    """The conventions that are recognised without a mapping file."""
    folder = resources.files("physique.motion") / "conventions"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return tuple(
        _parse(tomllib.loads(file.read_text(encoding="utf-8")), file.name[:-5], file.name) for file in files
    )


def plain_name(name: str) -> str:
    """A joint name without namespace, rig prefix, case and separators: "mixamorig:LeftArm" is
    "leftarm"."""
    spaced = re.sub(r"[\s_.\-|]+", " ", name.strip().lower())
    spaced = _PREFIX.sub("", spaced)
    return spaced.rsplit(":", 1)[-1].replace(" ", "")


def resolve(mapping: Mapping, clip: Clip) -> dict[str, tuple[int, ...]] | None:
    """For each body joint its chain of indices into the clip's joints; None if one is missing.

    Of a chain (a spine of one to five joints) those count that the skeleton has; "A|B" takes the
    first that it has. Names match exactly, or else as `plain_name`.
    """
    exact = {name: i for i, name in enumerate(clip.joints)}
    plain: dict[str, int] = {}
    for i, name in enumerate(clip.joints):
        plain.setdefault(plain_name(name), i)
    found: dict[str, tuple[int, ...]] = {}
    for body, chain in mapping.joints.items():
        indices = []
        for names in chain:
            for name in names.split("|"):
                index = exact.get(name, plain.get(plain_name(name)))
                if index is not None:
                    indices.append(index)
                    break
        if indices:
            found[body] = tuple(indices)
        elif body in REQUIRED:
            return None
    return found if _descends(found, clip) else None


def _descends(found: dict[str, tuple[int, ...]], clip: Clip) -> bool:
    """Whether each limb hangs together: a knee below its hip in the tree, and so on."""

    def below(child: int, ancestor: int) -> bool:
        while child >= 0 and child != ancestor:
            child = int(clip.parents[child])
        return child == ancestor

    limbs = (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
    for side in ("left", "right"):
        for limb in limbs:
            line = [i for part in limb for i in found[f"{side}_{part}"]]
            if any(a == b or not below(b, a) for a, b in pairwise(line)):
                return False
    return True


def recognize(clip: Clip) -> tuple[Mapping, dict[str, tuple[int, ...]]]:
    """The convention whose names the clip's skeleton has, and the indices of its joints.

    Raises InputError, listing the joints and naming the remedy, when there is none.
    """
    best: tuple[Mapping, dict[str, tuple[int, ...]]] | None = None
    for mapping in known_conventions():
        found = resolve(mapping, clip)
        if found is None:
            continue
        if best is None or _joint_count(found) > _joint_count(best[1]):
            best = (mapping, found)
    if best is None:
        names = [name for name in clip.joints if not re.search(r" end( \d+)?$", name)]
        raise InputError(
            clip.source,
            f"an unknown skeleton with the joints {joined(names)}",
            f"one of the conventions {', '.join(m.name for m in known_conventions())}",
            "write a mapping file as docs/motion.md shows and pass --mapping FILE.toml",
        )
    return best


def apply_mapping(mapping: Mapping, clip: Clip) -> dict[str, tuple[int, ...]]:
    """`resolve` for a user's mapping file, which must name joints that exist.

    Raises InputError naming the missing joint and listing those of the file.
    """
    plain = {plain_name(name) for name in clip.joints}
    for body, chain in mapping.joints.items():
        for names in chain:
            if not any(n in clip.joints or plain_name(n) in plain for n in names.split("|")):
                raise InputError(
                    f"mapping {mapping.name!r}, {body}",
                    f"the joint {shown(names)}",
                    f"a joint of {clip.source}: {joined(clip.joints)}",
                    "correct the name",
                )
    found = resolve(mapping, clip)
    if found is None:
        raise InputError(
            f"mapping {mapping.name!r}",
            "limbs that do not hang together",
            "each knee below its hip, each ankle below its knee, arms likewise",
            "correct the names",
        )
    return found


def _joint_count(found: dict[str, tuple[int, ...]]) -> int:
    return sum(len(chain) for chain in found.values())

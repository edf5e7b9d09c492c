"""The tree of section 4.2: nodes (x, u, L, p), the motion's own first, and its file.

Node t of the first T is frame t of the motion and leads to frame t + 1. A branch leads from a
perturbed state to a node of the tree, which it may reach beside its place: then what follows is
followed as much beside it. Physics is the same everywhere on a flat floor, so a body that was
pushed away may go on where it stands.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.store import PathLike, read_npz, write_npz

Array = NDArray[np.float64]
Index = NDArray[np.int32]

FORMAT = "physique-policy-1"
#: Gains are kept in half precision, one for so many nodes of a branch: they change slowly.
STRIDE = 3
GAIN_TYPE = np.float16


@dataclass(frozen=True)
class Branch:
    """M nodes from a perturbed state to the node `parent`.

    q (M, 57), v (M, 56), control (M, 50), com and com_velocity (M, 3); gains (ceil(M / STRIDE),
    50, 112); shift (2,) m: how far beside `parent` it ends. frame: of the motion at its first node.
    """

    q: Array
    v: Array
    control: Array
    com: Array
    com_velocity: Array
    gains: NDArray[np.float16]
    shift: Array
    parent: int
    frame: int


@dataclass(frozen=True)
class Tree:
    """n nodes, the first `frames` of them the motion.

    q (n, 57), v (n, 56), control (n, 50) rad, com and com_velocity (n, 3). gains (g, 50, 112),
    rad by the state's tangent, and gain (n,): which of them a node has. parent (n,), -1 for the
    last frame, which is held. frame (n,): of the motion at that time. branch (n,): -1 for the
    motion. shift (n, 2) m: that is added on the way to the parent.
    """

    q: Array
    v: Array
    control: Array
    com: Array
    com_velocity: Array
    gains: NDArray[np.float16]
    gain: Index
    parent: Index
    frame: Index
    branch: Index
    shift: Array

    @property
    def frames(self) -> int:
        """Frames T of the motion."""
        return int(np.sum(self.branch < 0))

    @property
    def branches(self) -> int:
        """Number of perturbed states that are led back."""
        return int(self.branch.max()) + 1


class PolicyFile(NamedTuple):
    """A policy as it is stored: the MuJoCo model (MJCF) that it is for, and facts about it."""

    xml: str
    tree: Tree
    facts: dict[str, Any]


def trunk(q: Array, v: Array, control: Array, com: Array, com_velocity: Array, gains: Array) -> Tree:
    """The motion alone: q (T, 57), v (T, 56), control (T - 1, 50), gains (T - 1, 50, 112)."""
    frames = len(q)
    number = np.arange(frames, dtype=np.int32)
    return Tree(
        q=q,
        v=v,
        # The last frame is held by what led to it.
        control=np.concatenate([control, control[-1:]]),
        com=com,
        com_velocity=com_velocity,
        gains=gains.astype(GAIN_TYPE),
        gain=np.minimum(number, frames - 2).astype(np.int32),
        parent=np.where(number + 1 < frames, number + 1, -1).astype(np.int32),
        frame=number,
        branch=np.full(frames, -1, dtype=np.int32),
        shift=np.zeros((frames, 2)),
    )


def grown(tree: Tree, branches: Sequence[Branch], gains: NDArray[np.float16] | None = None) -> Tree:
    """The tree with further branches, in their order.

    gains: those of the tree and the branches, one after the other, where they are together already.
    """
    if not branches:
        return tree
    parts: dict[str, list[Any]] = {f.name: [getattr(tree, f.name)] for f in fields(Tree)}
    nodes, known, last = len(tree.q), len(tree.gains), tree.frames - 1
    for number, branch in enumerate(branches, tree.branches):
        m = len(branch.q)
        steps = np.arange(m, dtype=np.int32)
        shift = np.zeros((m, 2))
        shift[-1] = branch.shift
        new = {
            **{n: getattr(branch, n) for n in ("q", "v", "control", "com", "com_velocity")},
            "gains": branch.gains,
            "gain": known + steps // STRIDE,
            "parent": np.append(nodes + 1 + steps[:-1], branch.parent),
            "frame": np.minimum(branch.frame + steps, last),
            "branch": np.full(m, number),
            "shift": shift,
        }
        for name, value in new.items():
            parts[name].append(value)
        nodes, known = nodes + m, known + len(branch.gains)
    if gains is not None:
        parts["gains"] = [gains]
    return Tree(
        **{
            name: np.concatenate(part).astype(part[0].dtype) if len(part) > 1 else part[0]
            for name, part in parts.items()
        }
    )


def save_policy(path: PathLike, xml: str, tree: Tree, about: Mapping[str, Any]) -> None:
    """Write the tree, the MuJoCo model (MJCF) it is for and facts about it: a policy file."""
    arrays: dict[str, Any] = {f.name: getattr(tree, f.name) for f in fields(Tree)}
    head = json.dumps({"format": FORMAT, **about}, sort_keys=True)
    write_npz(
        path, {**arrays, "head": np.array(head), "model": np.array(xml)}, compressed=False
    )  # gains do not get smaller


def read_policy(path: PathLike) -> PolicyFile:
    """What `save_policy` wrote.

    Raises InputError for a file that is missing, damaged or something else.
    """
    path = Path(path)
    arrays = read_npz(path)
    try:
        head = json.loads(str(arrays["head"]))
        known = head["format"] == FORMAT
        xml = str(arrays["model"])
        tree = Tree(**{f.name: arrays[f.name] for f in fields(Tree)})
    except (KeyError, TypeError, ValueError) as fault:
        raise _refusal(path, f"no policy (missing {fault})") from None
    if not known:
        raise _refusal(path, f"format {head['format']!r}")
    if not _fits(tree):
        raise _refusal(path, "arrays that do not fit together")
    return PolicyFile(xml, tree, head)


def _refusal(path: Path, found: str) -> InputError:
    return InputError(str(path), found, f"a policy file ({FORMAT})", "make it with `physique stabilize`")


def _fits(tree: Tree) -> bool:
    n = len(tree.q)
    shapes = {
        "q": (n, 57),
        "v": (n, 56),
        "control": (n, 50),
        "com": (n, 3),
        "com_velocity": (n, 3),
        "gain": (n,),
        "parent": (n,),
        "frame": (n,),
        "branch": (n,),
        "shift": (n, 2),
    }
    if n < 2 or any(getattr(tree, name).shape != shape for name, shape in shapes.items()):
        return False
    if tree.gains.ndim != 3 or tree.gains.shape[1:] != (50, 112) or len(tree.gains) == 0:
        return False
    whole = all(np.issubdtype(getattr(tree, k).dtype, np.integer) for k in ("gain", "parent"))
    return bool(
        whole
        and all(np.all(np.isfinite(getattr(tree, f.name))) for f in fields(Tree))
        and 0 <= tree.gain.min() <= tree.gain.max() < len(tree.gains)
        and -1 <= tree.parent.min() <= tree.parent.max() < n
        and 0 <= tree.frame.min() <= tree.frame.max() < tree.frames
    )

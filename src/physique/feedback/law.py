"""The linear law of nodes (Eq. 16), as position targets within the torque limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from physique.character.state import difference
from physique.feedback.tree import Tree
from physique.simulation.closed_loop import Servo

Array = NDArray[np.float64]

#: Feedback that would move a target further than this, rad, is scaled down as a whole: far from
#: where it was linearised, the law would throw the body about. Chosen by survival (docs).
BOUND = 0.3
_UNPACKED = 1024  # gains, 22 kB each


class Law:
    """What all followers of a tree share: the actuators, and the gains unpacked that were used
    last; unpacking them costs ten times as much as their use."""

    def __init__(self, servo: Servo, tree: Tree) -> None:
        self.servo, self.tree = servo, tree
        self.gain = lru_cache(maxsize=_UNPACKED)(self._unpack)

    def _unpack(self, number: int) -> NDArray[np.float32]:
        return self.tree.gains[number].astype(np.float32)


class Followers:
    """Places in the tree, and the way from each to the root.

    nodes (B,): where they are; shifts (B, 2) m: how far beside. feedback: false gives the nominal
    controls alone, which the actuators' PD controller follows.
    """

    def __init__(
        self, law: Law, nodes: Sequence[int], shifts: Sequence[Array], feedback: bool = True
    ) -> None:
        self._law, self._tree, self._feedback = law, law.tree, feedback
        self.nodes, self.shifts = np.array(nodes), np.array(shifts, dtype=np.float64)
        self._gain_of = np.full(len(self.nodes), -1)
        self._gains = np.empty((len(self.nodes), *law.tree.gains.shape[1:]), dtype=np.float32)

    def keep(self, order: NDArray[np.intp]) -> None:
        """Drop all but these."""
        self.nodes, self.shifts = self.nodes[order], self.shifts[order]
        self._gain_of, self._gains = self._gain_of[order], self._gains[order]

    def __call__(self, q: Array, v: Array) -> Array:
        """Targets (B, 50), rad, in the states q (B, 57), v (B, 56); goes on to the parents."""
        tree, nodes = self._tree, self.nodes
        targets = tree.control[nodes]
        if self._feedback:
            targets = targets + self._wanted(q, v)
        self.nodes, self.shifts = onward(tree, nodes, self.shifts)
        return self._law.servo.within_limits(targets, q, v)

    def _wanted(self, q: Array, v: Array) -> Array:
        tree, nodes = self._tree, self.nodes
        place = tree.q[nodes]
        place[:, :2] += self.shifts
        away = np.concatenate([difference(place, q), v - tree.v[nodes]], axis=1)
        numbers = tree.gain[nodes]
        for new in np.flatnonzero(numbers != self._gain_of):  # neighbours share them
            self._gains[new] = self._law.gain(int(numbers[new]))
        self._gain_of = numbers
        wanted = (self._gains @ away.astype(np.float32)[:, :, None])[:, :, 0]
        most = np.abs(wanted).max(axis=1, keepdims=True)
        return np.asarray(wanted * np.minimum(1.0, BOUND / np.maximum(most, BOUND)))


@dataclass(frozen=True)
class Path:
    """Nodes (n,) on the way to the root, and how far (n, 2), m, beside each the body goes."""

    nodes: NDArray[np.int64]
    shift: Array


def path(tree: Tree, node: int, steps: int) -> Path:
    """The first `steps` nodes from `node` towards the root."""
    nodes, shifts = [np.array([node])], [np.zeros((1, 2))]
    for _ in range(steps - 1):
        ahead, beside = onward(tree, nodes[-1], shifts[-1])
        nodes.append(ahead)
        shifts.append(beside)
    return Path(np.concatenate(nodes), np.concatenate(shifts))


def onward(tree: Tree, nodes: NDArray[np.int64], shifts: Array) -> tuple[NDArray[np.int64], Array]:
    """The parents of nodes (B,) and how far (B, 2), m, beside these the body goes; the last frame
    is held."""
    parents = tree.parent[nodes]
    goes = parents >= 0
    leaves = goes & (tree.branch[parents] != tree.branch[nodes])
    beside = shifts + np.where(leaves[:, None], tree.shift[nodes], 0.0)
    return np.where(goes, parents, nodes), beside

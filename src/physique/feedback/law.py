"""The linear law of a node (Eq. 16), as position targets within the torque limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique.feedback.tree import Tree
from physique.simulation.closed_loop import Servo

Array = NDArray[np.float64]

#: Feedback that would move a target further than this, rad, is scaled down as a whole: far from
#: where it was linearised, the law would throw the body about. Chosen by survival (docs).
BOUND = 0.3


class Follower:
    """A place in the tree, and the way from there to the root.

    node: where it is; shift (2,) m: how far beside. feedback: false gives the nominal controls
    alone, which the actuators' PD controller follows.
    """

    def __init__(
        self, servo: Servo, tree: Tree, node: int, shift: Array, feedback: bool = True
    ) -> None:
        self._servo, self._tree, self._feedback = servo, tree, feedback
        self.node, self.shift = node, shift
        self._q = np.empty(57)
        self._away = np.empty(112)
        self._gain_of = (
            -1
        )  # nodes of a branch share gains; unpacking them costs as much as their use

    def __call__(self, q: Array, v: Array) -> Array:
        """Targets (50,), rad, in the state q (57,), v (56,); goes on to the parent."""
        tree, node = self._tree, self.node
        targets = tree.control[node]
        if self._feedback:
            self._q[:] = tree.q[node]
            self._q[:2] += self.shift
            self._servo.difference(self._q, tree.v[node], q, v, self._away)
            number = int(tree.gain[node])
            if number != self._gain_of:
                self._gain, self._gain_of = tree.gains[number].astype(np.float32), number
            wanted = self._gain @ self._away.astype(np.float32)
            most = float(np.abs(wanted).max())
            targets = targets + (wanted if most <= BOUND else wanted * (BOUND / most))
        parent = int(tree.parent[node])
        if parent >= 0:
            if tree.branch[parent] != tree.branch[node]:
                self.shift = self.shift + tree.shift[node]
            self.node = parent
        return self._servo.within_limits(targets, q, v)


@dataclass(frozen=True)
class Path:
    """Nodes (n,) on the way to the root, and how far (n, 2), m, beside each the body goes."""

    nodes: NDArray[np.int64]
    shift: Array


def path(tree: Tree, node: int, steps: int) -> Path:
    """The first `steps` nodes from `node` towards the root."""
    nodes, shifts, shift = [], [], np.zeros(2)
    for _ in range(steps):
        nodes.append(node)
        shifts.append(shift)
        parent = int(tree.parent[node])
        if parent >= 0:
            if tree.branch[parent] != tree.branch[node]:
                shift = shift + tree.shift[node]
            node = parent
    return Path(np.array(nodes), np.array(shifts))

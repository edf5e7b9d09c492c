"""Which node of the tree to follow from a state: the nearest ones, tried by roll-outs (4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.feedback.law import Followers, Law
from physique.feedback.tree import Tree
from physique.reference.target import joint_weights
from physique.simulation.probes import Probes

Array = NDArray[np.float64]

#: zeta of Algorithm 1: L of Eq. 21 below which the tree stands a state.
ZETA = 1.5
_JOINTS = joint_weights()
#: L of a fall after one step; it is the less, the longer the body stands.
_FALL = 1e6


@dataclass(frozen=True)
class ChoiceOptions:
    """kappa: nodes that are tried. alpha: frames that a node's time may be off. reach: m that a
    body may go beside its motion.

    stages: (steps, how many go on) of the roll-outs, so that few are rolled out far. lowest: the
    share of its usual height to which the centre of mass may sink.
    """

    kappa: int = 20
    alpha: int = 25
    reach: float = 0.4
    stages: tuple[tuple[int, int], ...] = ((20, 5), (40, 2), (60, 1))
    lowest: float = 0.6


DEFAULT = ChoiceOptions()


@dataclass(frozen=True)
class Choice:
    """Follow the tree from `node`, `shift` (2,) m beside it.

    q (n, 57), v (n, 56): what that leads to, from the present state on. loss: L of Eq. 21.
    """

    node: int
    shift: Array
    q: Array
    v: Array
    loss: float


class Chooser:
    """Finds the best node to follow. steps: that it has simulated."""

    def __init__(self, law: Law, options: ChoiceOptions, threads: int) -> None:
        self._law, self.tree, self._options = law, law.tree, options
        tree = law.tree
        self.steps = 0
        self._probes = Probes(law.servo.model, threads)
        self._features = features(tree.q, tree.v, tree.com, tree.com_velocity)
        self._lowest = options.lowest * float(np.min(tree.com[: tree.frames, 2]))

    def choose(self, q: Array, v: Array, clock: int, now: tuple[int, Array] | None = None) -> Choice:
        """The best way on from q (57,), v (56,) at frame `clock` of the motion.

        now: the node and the shift that are followed, to be tried too.
        """
        places = self._candidates(q, v, clock)
        if now is not None:
            places = [now, *places]
        nodes, shifts = zip(*places)
        followers = Followers(self._law, nodes, shifts)
        probes, ways = self._probes, np.arange(len(places))
        probes.start(q, v, len(places))
        # What comes after the motion's end does not count.
        left = max(self.tree.frames - 1 - clock, self._options.stages[0][0])
        for steps, keep in self._options.stages:
            before = int(probes.steps.sum())
            probes.run(min(steps, left), followers, self._lowest)
            self.steps += int(probes.steps.sum()) - before
            left -= min(steps, left)
            losses = self._losses(probes, clock)
            order = np.argsort(losses, kind="stable")[:keep]
            ways, losses = ways[order], losses[order]
            probes.keep(order)
            followers.keep(order)
        node, shift = places[ways[0]]
        reached = int(probes.steps[0]) + 1
        return Choice(node, shift, probes.q[:reached, 0], probes.v[:reached, 0], float(losses[0]))

    def _losses(self, probes: Probes, clock: int) -> Array:
        """L of Eq. 21 (B,) of roll-outs that began at frame `clock`.

        A fall is worse than any way that stands, and the worse the sooner it comes.
        """
        falls = _FALL / probes.steps
        if probes.fallen.all():
            return falls
        frames = np.minimum(clock + np.arange(len(probes.com)), self.tree.frames - 1)
        far = distance(self.tree, frames[:, None], probes.q[:-1], probes.com, probes.com_velocity)
        return np.where(probes.fallen, falls, along(far))

    def _candidates(self, q: Array, v: Array, clock: int) -> list[tuple[int, Array]]:
        """Nodes near the state and the shifts to follow them with, at most kappa."""
        tree, o = self.tree, self._options
        com, com_velocity = self._law.servo.center(q, v)
        here = features(q[None], v[None], com[None], com_velocity[None])[0]
        near = np.flatnonzero(np.abs(tree.frame - min(clock, tree.frames - 1)) <= o.alpha)
        far = np.sum((self._features[near] - here) ** 2, axis=1)
        order = near[np.argsort(far, kind="stable")]
        own = order[tree.branch[order] < 0]
        out: list[tuple[int, Array]] = []
        for node in _spread(own, 8)[:3]:
            aside = (com - tree.com[node])[:2]
            excess = (com_velocity - tree.com_velocity[node])[:2]
            for shift in (np.zeros(2), aside, aside + 0.3 * excess):
                out.append((int(node), _within(shift, o.reach)))
        others = order[tree.branch[order] >= 0]
        _, first = np.unique(tree.branch[others], return_index=True)
        for node in others[np.sort(first)]:
            if len(out) >= o.kappa:
                break
            out.append((int(node), (com - tree.com[node])[:2]))
        return out


def _spread(nodes: NDArray[np.intp], apart: int) -> list[int]:
    """Those of `nodes`, best first, that are not within `apart` of a better one."""
    out: list[int] = []
    for node in nodes.tolist():
        if all(abs(node - other) >= apart for other in out):
            out.append(node)
    return out


def _within(shift: Array, reach: float) -> Array:
    length = float(np.linalg.norm(shift))
    return shift * (reach / length) if length > reach else shift


def features(q: Array, v: Array, com: Array, com_velocity: Array) -> NDArray[np.float32]:
    """What makes states (n, .) near to each other, wherever on the floor they are: (n, 116).

    The weights are those of the state in the LQR's cost.
    """
    R = rotations.to_matrix(q[:, 3:7]).reshape(len(q), 9)
    parts = [
        30.0**0.5 * com[:, 2:],
        4.0**0.5 * com_velocity,
        2.0**0.5 * R,  # |R - S|^2 is twice the angle's square
        v[:, 3:6],
        6.0**0.5 * q[:, 7:],
        0.1**0.5 * v[:, 6:],
    ]
    return np.concatenate(parts, axis=1).astype(np.float32)


def along(far: Array) -> Array:
    """L of Eq. 21 (...) of paths whose states are far (n, ...) from the motion's."""
    return np.asarray(far[:-1].mean(axis=0) + 10.0 / (len(far) - 1) * far[-1])


def distance(tree: Tree, frames: NDArray[np.intp], q: Array, com: Array, velocity: Array) -> Array:
    """dist of Eq. 21 (...): what Eqs. 3, 4, 5 and 7 sum, of states (..., .) from `frames`."""
    wanted = tree.q[frames]
    half = np.abs(np.sum(q[..., 3:7] * wanted[..., 3:7], axis=-1))
    return np.asarray(
        15.0 * np.sum((com - tree.com[frames]) ** 2, axis=-1)
        + 0.5 * np.sum((velocity - tree.com_velocity[frames]) ** 2, axis=-1)
        + 0.5 * np.sum(_JOINTS * (q[..., 7:] - wanted[..., 7:]) ** 2, axis=-1)
        + 4.0 * np.arccos(np.minimum(half, 1.0))
    )

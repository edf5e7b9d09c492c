"""The controller that other programs run: one file, NumPy and MuJoCo, no compiler.

policy = load_policy("out/punch/policy.npz")
policy.reset()
while policy.time < policy.seconds:
    data.ctrl[:] = policy.act(data.qpos, data.qvel)
    mujoco.mj_step(model, data)
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.feedback.choice import DEFAULT, Choice, ChoiceOptions, Chooser
from physique.feedback.law import Followers, Law
from physique.feedback.tree import PolicyFile, Tree, read_policy
from physique.simulation.closed_loop import Servo
from physique.store import PathLike

Array = NDArray[np.float64]

ControllerName = Literal["pd", "lqr", "tree"]
ControlName = Literal["targets", "torques"]

#: A state that is this far from what was foreseen, in the weights of `_gap`, was pushed.
_SURPRISE = 0.01
#: A step that leads this far from what it should is being pushed. A decision waits for the push's
#: end, but at most so many steps: while it lasts nothing that is foreseen comes true.
_PUSHED, _WAIT = 1e-6, 20
#: Steps that a decision stands at least; at most, while what it leads to is no good.
_REST, _PATIENCE = 3, 5
#: L of Eq. 21 from which on a way is no good.
_POOR = 1.0
#: A way that is less than perfect, L above this, is looked at again after so many steps: what was
#: foreseen ends before the motion does.
_GOOD, _RENEWAL = 0.1, 30


class Policy:
    """Feedback along a motion, with a memory of where it is in it.

    controller: "pd", the nominal controls alone; "lqr", Eq. 16 along the motion; "tree", which
    also looks for the best node to follow whenever something unforeseen happened.
    control: what `act` gives: "targets" (50,), rad, for the position servos of the character's own
    model, or "torques" (50,), Nm, for `motor_model`, held over a step.

    model_xml: MJCF of the character. timestep: s between calls of `act`. seconds: of the motion.
    """

    def __init__(
        self,
        xml: str,
        tree: Tree,
        controller: ControllerName = "lqr",
        control: ControlName = "targets",
        options: ChoiceOptions = DEFAULT,
        threads: int = 2,
    ) -> None:
        self.model_xml, self.tree, self.controller, self.control = xml, tree, controller, control
        self._servo = Servo(xml)
        self._law = Law(self._servo, tree)
        self._chooser = Chooser(self._law, options, threads) if controller == "tree" else None
        self.timestep = self._servo.timestep
        self.reset()

    def reset(self, frame: int = 0) -> None:
        """Go back to the beginning of the motion, or to a frame of it."""
        if not 0 <= frame < self.tree.frames:
            raise InputError("frame of the policy", str(frame), f"0 to {self.tree.frames - 1}", "correct it")
        self._clock = frame
        self._follower = Followers(self._law, [frame], [np.zeros(2)], self.controller != "pd")
        tree = self.tree
        self._ahead = Choice(
            frame, np.zeros(2), tree.q[frame : tree.frames], tree.v[frame : tree.frames], 0.0
        )
        self._since = self._waited = 0
        self._next: tuple[Array, Array] | None = None
        self.decisions = 0

    @property
    def frame(self) -> int:
        """Frame of the motion that the next call is for."""
        return min(self._clock, self.tree.frames - 1)

    @property
    def time(self) -> float:
        """s since the motion began."""
        return self._clock * self.timestep

    @property
    def seconds(self) -> float:
        """Duration of the motion; afterwards its last frame is held."""
        return (self.tree.frames - 1) * self.timestep

    @property
    def branch(self) -> int:
        """Number of the branch that is followed, -1 for the motion itself."""
        return int(self.tree.branch[self._follower.nodes[0]])

    @property
    def initial_state(self) -> tuple[Array, Array]:
        """q (57,) and v (56,) that the motion starts in."""
        return self.tree.q[0].copy(), self.tree.v[0].copy()

    @property
    def simulated_steps(self) -> int:
        """Steps that decisions have simulated so far."""
        return 0 if self._chooser is None else self._chooser.steps

    def act(self, q: Array, v: Array) -> Array:
        """The control (50,) for the step from the state q (57,), v (56,); one call a step."""
        q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
        if self._chooser is not None and not self._pushed(q, v) and self._should_decide(q, v):
            now = int(self._follower.nodes[0]), self._follower.shifts[0]
            self._ahead = self._chooser.choose(q, v, self._clock, now)
            self._follower = Followers(self._law, [self._ahead.node], [self._ahead.shift])
            self._since = 0
            self.decisions += 1
        targets = self._follower(q[None], v[None])[0]
        if self._chooser is not None:
            self._next = self._servo.step(q, v, targets)
        self._clock += 1
        self._since += 1
        return targets if self.control == "targets" else self._servo.torques(targets, q, v)

    def _pushed(self, q: Array, v: Array) -> bool:
        """Whether a push was at work in the step that led to (q, v), and is new enough to wait."""
        pushed = self._next is not None and _gap(*self._next, q, v) > _PUSHED
        self._waited = self._waited + 1 if pushed else 0
        return 0 < self._waited <= _WAIT

    def _should_decide(self, q: Array, v: Array) -> bool:
        ahead, now = self._ahead, self._since
        if self.decisions and now < _REST:
            return False
        if now < len(ahead.q):
            surprised = _gap(ahead.q[now], ahead.v[now], q, v) > _SURPRISE
            poor = now >= (_PATIENCE if ahead.loss > _POOR else _RENEWAL)
            return surprised or (ahead.loss > _GOOD and poor)
        return ahead.loss > 0.0 and now % _PATIENCE == 0


def load_policy(
    path: PathLike,
    controller: ControllerName | None = None,
    control: ControlName = "targets",
    threads: int = 2,
) -> Policy:
    """The policy in a file; with the tree where it has one, unless `controller` says otherwise.

    Raises InputError for a file that is missing, damaged or no policy, and for a controller that
    it does not have.
    """
    return make_policy(str(path), read_policy(path), controller, control, threads)


def make_policy(
    place: str,
    stored: PolicyFile,
    controller: ControllerName | None = None,
    control: ControlName = "targets",
    threads: int = 2,
) -> Policy:
    """The policy that was read from the file `place`; as `load_policy`."""
    tree = stored.tree
    for value, names in ((controller, get_args(ControllerName)), (control, get_args(ControlName))):
        if value is not None and value not in names:
            raise InputError("policy option", repr(value), ", ".join(names), "choose one of them")
    if controller == "tree" and tree.branches == 0:
        found, remedy = "a policy without a tree", "grow it with `physique grow`"
        if "tree" in stored.facts:
            found = "a tree without branches, since lqr stood all that it was grown against"
            remedy = "take the controller lqr, or grow against greater --forces"
        raise InputError(place, found, "one with a tree", remedy)
    name = controller or ("tree" if tree.branches else "lqr")
    return Policy(stored.xml, tree, name, control, threads=threads)


def _gap(q_from: Array, v_from: Array, q: Array, v: Array) -> float:
    """How far a state is from another; a squared distance, of positions and velocities alike."""
    turn = 1.0 - float(np.dot(q_from[3:7], q[3:7])) ** 2
    dq, dv = q - q_from, v - v_from
    return float(
        15.0 * dq[:3] @ dq[:3]
        + 4.0 * turn
        + 0.5 * dq[7:] @ dq[7:]
        + 0.5 * dv[:3] @ dv[:3]
        + 0.05 * dv[3:6] @ dv[3:6]
        + 0.0005 * dv[6:] @ dv[6:]
    )

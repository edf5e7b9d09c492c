"""The connector as published, on the standing motion with few samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physique.character import kinematics
from physique.feedback.choice import along, distance
from physique.feedback.cma_connect import CmaConnectOptions, connect
from physique.feedback.connect import Trunk
from physique.feedback.law import BOUND, path
from physique.feedback.tree import Branch, Tree
from physique.runs.run import Run
from physique.simulation.linear_feedback import Feedback
from physique.simulation.mujoco_simulator import MujocoSimulator

FEW = CmaConnectOptions(steps=10, samples=8, iterations=6, sigma=0.05, ahead=20, alpha=10)
FRAME = 10


@pytest.fixture(scope="module")
def pushed(trunk: Trunk) -> tuple[np.ndarray, np.ndarray]:
    """A state with 0.2 m/s to the left."""
    v = trunk.v[FRAME].copy()
    v[1] += 0.2
    return trunk.q[FRAME].copy(), v


@pytest.fixture(scope="module")
def branch(run: Run, trunk: Trunk, tree: Tree, pushed: tuple) -> Branch:
    with MujocoSimulator(run.character(), 1) as simulator:
        found = connect(simulator, trunk, tree, *pushed, FRAME, np.random.default_rng(0), FEW)
    assert found is not None
    return found


def test_a_branch_starts_at_the_state_and_replays(run: Run, branch: Branch, pushed: tuple) -> None:
    q, v = pushed
    assert np.array_equal(branch.q[0], q)
    assert np.array_equal(branch.v[0], v)
    assert branch.frame == FRAME
    assert len(branch.q) == len(branch.v) == len(branch.control) == FEW.steps
    with MujocoSimulator(run.character(), 1) as simulator:
        again = simulator.run(q, v, FEW.steps, [lambda t, q, v: branch.control[t]])[0]
    np.testing.assert_allclose(again.q[:-1], branch.q, atol=1e-9)
    np.testing.assert_allclose(again.v[:-1], branch.v, atol=1e-7)


def test_it_ends_on_the_node_that_it_names(
    run: Run, trunk: Trunk, tree: Tree, branch: Branch, pushed: tuple
) -> None:
    assert abs(tree.frame[branch.parent] - FRAME - FEW.steps) <= FEW.alpha
    way = path(tree, branch.parent, min(FEW.ahead, trunk.last - FRAME - FEW.steps))
    gains = tree.gains[tree.gain[way.nodes]].astype(float)
    follow = Feedback(
        run.character(), tree.q[way.nodes], tree.v[way.nodes], tree.control[way.nodes], gains, BOUND
    )
    with MujocoSimulator(run.character(), 1) as simulator:
        led = simulator.run(*pushed, FEW.steps, [lambda t, q, v: branch.control[t]])[0]
        after = simulator.run(led.q[-1], led.v[-1], len(way.nodes), [follow])[0]
    there, node = (
        kinematics.joint_positions(run.character(), q[None])[0] for q in (led.q[-1], tree.q[branch.parent])
    )
    assert np.linalg.norm(there - node, axis=1).mean() < 0.1
    # From there on the node's controllers keep L of Eq. 21 below zeta.
    frames = np.minimum(FRAME + FEW.steps + np.arange(len(after.q)), trunk.last)
    assert along(distance(tree, frames, after.q, after.com, after.com_velocity)) < FEW.zeta


def test_the_same_seed_gives_the_same_branch(
    run: Run, trunk: Trunk, tree: Tree, branch: Branch, pushed: tuple
) -> None:
    with MujocoSimulator(run.character(), 2) as simulator:
        again = connect(simulator, trunk, tree, *pushed, FRAME, np.random.default_rng(0), FEW)
    assert again is not None
    assert np.array_equal(again.control, branch.control)


def test_what_cannot_be_led_back_is_none(run: Run, trunk: Trunk, tree: Tree, pushed: tuple) -> None:
    rng = np.random.default_rng(0)
    with MujocoSimulator(run.character(), 1) as simulator:
        strict = replace(FEW, zeta=1e-6, iterations=2)
        assert connect(simulator, trunk, tree, *pushed, FRAME, rng, strict) is None
        # All samples of all iterations were tried.
        rollout = FEW.steps + min(FEW.ahead, trunk.last - FRAME - FEW.steps)
        assert simulator.steps == 2 * FEW.samples * rollout
        # Too near to the motion's end there is nothing to try.
        assert connect(simulator, trunk, tree, *pushed, trunk.last - FEW.steps, rng, FEW) is None
        assert simulator.steps == 2 * FEW.samples * rollout

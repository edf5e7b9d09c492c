"""Online choice, and branches that lead back to the motion."""

from __future__ import annotations

import numpy as np
import pytest

from physique.feedback.choice import DEFAULT, ZETA, Chooser, distance
from physique.feedback.connect import ConnectOptions, Trunk, connect, takeover
from physique.feedback.grow import ROUND, Settings, plan
from physique.feedback.law import Law
from physique.feedback.tree import Tree, grown
from physique.runs.run import Run
from physique.simulation.closed_loop import Servo
from physique.simulation.mujoco_simulator import MujocoSimulator


@pytest.fixture(scope="module")
def pushed(trunk: Trunk) -> tuple[np.ndarray, np.ndarray]:
    """A state with half a metre a second to the left."""
    v = trunk.v[10].copy()
    v[1] += 0.5
    return trunk.q[10].copy(), v


def test_the_choice_knows_where_its_way_leads(run: Run, tree: Tree) -> None:
    chooser = Chooser(Law(Servo(run.character_xml), tree), DEFAULT, threads=1)
    choice = chooser.choose(tree.q[10], tree.v[10], 10)
    assert choice.node == 10
    assert choice.loss < 1e-3
    steps = min(len(choice.q), tree.frames - 10)
    np.testing.assert_allclose(choice.q[:steps], tree.q[10 : 10 + steps], atol=0.01)
    assert 0 < chooser.steps <= 20 * 20 + 5 * 40 + 2 * 60


def test_threads_do_not_change_the_choice(run: Run, tree: Tree, pushed: tuple) -> None:
    found = [
        Chooser(Law(Servo(run.character_xml), tree), DEFAULT, threads).choose(*pushed, 10)
        for threads in (1, 3)
    ]
    assert found[0].node == found[1].node
    assert found[0].loss == found[1].loss
    assert np.array_equal(found[0].q, found[1].q)


def test_distance_is_zero_at_the_node_and_grows(tree: Tree) -> None:
    frames = np.arange(5)
    at = (tree.q[:5].copy(), tree.com[:5].copy(), tree.com_velocity[:5])
    assert np.abs(distance(tree, frames, *at)).max() < 1e-5
    at[1][:, 0] += 0.2
    np.testing.assert_allclose(distance(tree, frames, *at), 15 * 0.04, rtol=1e-4)


def test_a_branch_leads_from_the_state_to_the_motion(
    run: Run, trunk: Trunk, tree: Tree, pushed: tuple
) -> None:
    with MujocoSimulator(run.character(), 1) as simulator:
        branch = connect(simulator, trunk, *pushed, 10)
        assert branch is not None
        assert np.array_equal(branch.q[0], pushed[0])
        # Every node leads to the next one: it is a simulation.
        data = simulator.run(
            branch.q[0], branch.v[0], len(branch.q) - 1, [lambda t, q, v: branch.control[t]]
        )[0]
        np.testing.assert_allclose(data.q, branch.q, atol=1e-9)
        assert branch.parent == min(10 + len(branch.q), trunk.last)
        # The same state one step on is not taken for a fall by the motion's own LQR ...
        assert takeover(simulator, trunk, trunk.q[10], trunk.v[10], 10, ConnectOptions()) is not None
        # ... but a falling one is.
        assert (
            takeover(simulator, trunk, pushed[0], trunk.v[10] + 4 * np.eye(56)[1], 10, ConnectOptions())
            is None
        )


def test_a_branch_is_needed_and_helps(run: Run, trunk: Trunk, tree: Tree) -> None:
    """A push to the left, of which the motion's own feedback alone makes a fall."""
    pushed = trunk.q[10], trunk.v[10] + 0.8 * np.eye(56)[1]
    with MujocoSimulator(run.character(), 1) as simulator:
        branch = connect(simulator, trunk, *pushed, 10)
    assert branch is not None
    without, with_it = (
        Chooser(Law(Servo(run.character_xml), t), DEFAULT, 1).choose(*pushed, 10)
        for t in (tree, grown(tree, [branch]))
    )
    assert with_it.loss < ZETA < without.loss
    assert with_it.node >= tree.frames


def test_the_plan_runs_from_the_end_and_halves(trunk: Trunk) -> None:
    rounds = plan(Settings(interval=0.2, forces=(50.0, 100.0), trials=ROUND + 2, passes=2), 61, 0.01)
    assert [r.index for r in rounds] == list(range(len(rounds)))
    frames = [r.frame for r in rounds]
    assert frames[:4] == [40] * 4
    assert sorted(set(frames)) == [0, 10, 20, 30, 40, 50]
    assert frames.index(50) > frames.index(0)  # the second pass comes after the first
    assert [r.first for r in rounds] == np.cumsum([0, *(r.count for r in rounds)])[:-1].tolist()
    assert sum(r.count for r in rounds) == 6 * 2 * (ROUND + 2)

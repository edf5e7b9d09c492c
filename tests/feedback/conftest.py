"""A short simulated motion: standing, 0.6 s, and its policy."""

from __future__ import annotations

from pathlib import Path

import pytest

from physique.commands.retarget import retarget
from physique.commands.stabilize import stabilize
from physique.experiments.standing import standing
from physique.feedback.connect import Trunk, make_trunk
from physique.feedback.growth import root
from physique.feedback.tree import Tree
from physique.motion.read import trim
from physique.runs.run import Run
from physique.simulation.mujoco_simulator import MujocoSimulator


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """0.6 s of standing on the average body, stabilised."""
    folder = tmp_path_factory.mktemp("standing") / "run"
    made = retarget(trim(standing("average"), end=0.6), "average", threads=1, out=folder)
    stabilize(folder)
    return made


@pytest.fixture(scope="session")
def folder(run: Run) -> Path:
    """Where the run is stored."""
    assert run.folder is not None
    return run.folder


@pytest.fixture(scope="session")
def trunk(run: Run) -> Trunk:
    """Its motion with LQR."""
    motion = run.trajectory
    with MujocoSimulator(run.character(), 1) as simulator:
        return make_trunk(simulator, motion.q, motion.v, motion.control)


@pytest.fixture(scope="session")
def tree(trunk: Trunk) -> Tree:
    """The tree of the motion alone."""
    return root(trunk)

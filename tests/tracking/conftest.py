"""The average body and 0.4 s of a walk as a problem."""

from __future__ import annotations

import numpy as np
import pytest

from physique.character.model import Character
from physique.reference.reference import Reference
from physique.simulation.rollout import Rollout
from physique.tracking.problem import Problem, nominal_motion


@pytest.fixture(scope="session")
def problem(character: Character, walk: Reference) -> Problem:
    """0.4 s of the walk from the reference's own state."""
    target = walk.target(20, 61, np.zeros(2))
    return Problem(character, walk.q[20], walk.v[20], target)


@pytest.fixture(scope="session")
def nominal(problem: Problem) -> Rollout:
    """The reference as if it had been simulated."""
    target = problem.target
    return nominal_motion(problem, target.q, target.v, target.q[1:, 7:])

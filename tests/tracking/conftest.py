"""The average body and 0.4 s of a walk as a problem."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.motion.read import read_motion
from physique.simulation.character import Character, make_character
from physique.simulation.quiet import quiet
from physique.simulation.rollout import Rollout
from physique.tracking.problem import Problem, nominal_motion
from physique.tracking.reference import Reference, make_reference


@pytest.fixture(scope="session", autouse=True)
def _quiet() -> Iterator[None]:
    """Wild samples blow up now and then; tests need no log file of it."""
    with quiet():
        yield


@pytest.fixture(scope="session")
def character() -> Character:
    return make_character(capsule_body(named_body("average")), 100.0)


@pytest.fixture(scope="session")
def walk(character: Character) -> Reference:
    return make_reference(read_motion("walk"), character)


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

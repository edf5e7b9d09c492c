"""The benchmarks' scripts as modules, and a short stretch of a walk as a problem."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from compare_optimizers import Window, make_problem
from physique.character.model import Character
from physique.tracking.problem import Problem

STEPS = 30


@pytest.fixture(scope="session")
def problem(character: Character) -> Problem:
    """0.3 s of the walk: two intervals of the CEM's knots, the second one cut short."""
    return make_problem(character, Window("walk", "walk", 0.2)).beginning(STEPS)

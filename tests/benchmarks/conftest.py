"""The benchmarks' scripts as modules, and a short stretch of a walk as a problem."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from compare_optimizers import Window, make_problem
from physique.simulation.character import Character
from physique.tracking.costs import Target
from physique.tracking.problem import Problem

STEPS = 30


@pytest.fixture(scope="session")
def problem(character: Character) -> Problem:
    """0.3 s of the walk: two intervals of the CEM's knots, the second one cut short."""
    whole = make_problem(character, Window("walk", "walk", 0.2))
    target = whole.target
    frames = (target.q, target.v, target.com, target.com_velocity)
    return replace(whole, target=Target(*(a[: STEPS + 1] for a in frames)))

"""Short runs for the tests of the page."""

from __future__ import annotations

from pathlib import Path

import pytest
from standing import Balance, Standing, make_standing

from physique.body.mesh import BodyMesh
from physique.body.named import named_body
from physique.run import Run, finish_run


@pytest.fixture(scope="session")
def mesh() -> BodyMesh:
    return named_body("average")


@pytest.fixture(scope="session")
def balanced(mesh: BodyMesh) -> Standing:
    return make_standing(mesh)


@pytest.fixture(scope="session")
def standing(balanced: Standing) -> Run:
    return balanced.run


@pytest.fixture(scope="session")
def folder(standing: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run, stored."""
    where = tmp_path_factory.mktemp("run")
    finish_run(where, standing)
    return where


@pytest.fixture(scope="session")
def balance(balanced: Standing) -> Balance:
    """What a policy does, in a few lines: linear feedback about the run."""
    return Balance(balanced)

"""What the tests of reports and of the live page share: short runs, and one browser for all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from physique.body.mesh import BodyMesh
from physique.body.named import named_body
from physique.character.model import Character
from physique.runs.run import Run, finish_run
from standing import Balance, Standing, make_standing

#: Chromium without a display, which draws in software.
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@pytest.fixture(scope="session")
def mesh() -> BodyMesh:
    return named_body("average")


@pytest.fixture(scope="session")
def balanced(mesh: BodyMesh, character: Character) -> Standing:
    return make_standing(mesh, character.body)


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


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("needs Chromium (Debian, Ubuntu: apt install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=path, args=list(FLAGS))
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def pictures() -> Path:
    """Where screenshots stay, to be looked at."""
    folder = Path(__file__).resolve().parents[1] / "out" / "tests"
    folder.mkdir(parents=True, exist_ok=True)
    return folder

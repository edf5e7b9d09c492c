"""What all tests share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.motion.read import read_motion
from physique.simulation.character import Character, make_character
from physique.simulation.quiet import quiet
from physique.tracking.reference import Reference, make_reference

MOCAP = Path(__file__).resolve().parents[2] / "shared" / "mocap"


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real clips, which stands beside the repository and is not part of it."""
    if not (MOCAP / "MANIFEST.tsv").is_file():
        pytest.skip("needs real motion-capture clips in ../shared/mocap beside the repository")
    return MOCAP


@pytest.fixture(scope="session", autouse=True)
def _quiet() -> Iterator[None]:
    """Tests that blow a simulation up, on purpose or not, need no log file of it."""
    with quiet():
        yield


@pytest.fixture(scope="session")
def character() -> Character:
    """The average body, 100 Nm at every joint."""
    return make_character(capsule_body(named_body("average")), 100.0)


@pytest.fixture(scope="session")
def walk(character: Character) -> Reference:
    """The embedded walk on the average body."""
    return make_reference(read_motion("walk"), character)

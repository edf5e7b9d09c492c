"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

MOCAP = Path(__file__).resolve().parents[2] / "shared" / "mocap"


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real clips, which stands beside the repository and is not part of it."""
    if not (MOCAP / "MANIFEST.tsv").is_file():
        pytest.skip("needs real motion-capture clips in ../shared/mocap beside the repository")
    return MOCAP

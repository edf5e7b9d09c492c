"""The demo makes its runs and pictures of them, with nothing but what ships with the package."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from physique.commands import demo
from physique.errors import InputError
from physique.runs.run import load_run


def test_the_demo_leaves_runs_and_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "END", 0.1)
    monkeypatch.setattr(demo, "PANEL", (60, 60))
    monkeypatch.setattr(demo, "FILM", (96, 48))
    heard = []
    result = demo.run_demo(tmp_path / "demo", threads=1, progress=heard.append)
    assert [run.body.name for run in result.runs] == ["average", "heavy"]
    assert [load_run(tmp_path / "demo" / n).name for n in demo.BODIES] == [r.name for r in result.runs]
    assert heard
    assert result.pictures == (tmp_path / "demo" / "demo.png", tmp_path / "demo" / "demo.webp")
    with Image.open(result.pictures[0]) as sheet:
        assert sheet.size == (demo.FRAMES * 62 - 2, 2 * 62 - 2)
        rows = np.asarray(sheet).astype(int)
    # A person of flesh, and not of red and blue shapes, in each row.
    for row in (rows[:60], rows[62:]):
        skin = (row[..., 0] - row[..., 2] > 40) & (row[..., 0] > row[..., 1]) & (row[..., 1] > row[..., 2])
        assert skin[:, :60].sum() > 40
        assert skin[:, :30].sum() < 0.2 * skin[:, 30:60].sum()  # left is the ghost
    with Image.open(result.pictures[1]) as film:
        assert film.size == (96, 48)
        assert film.info["loop"] == 0
        assert film.n_frames == 2  # 0.1 s at 12.5 a second


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        demo.run_demo(tmp_path / "file")

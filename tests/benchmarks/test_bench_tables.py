"""The long tables of the benchmarks: what is stored is not made again."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import matrix
import run as table
from physique.experiments.cells import Cells


def metrics(error: float) -> dict[str, Any]:
    return {
        "success": True,
        "mpjpe_mm": error,
        "mpjpe_max_mm": 3 * error,
        "foot_skate_planted_mm_per_s": 50.0,
        "foot_skate_source_mm_per_s": 60.0,
        "penetration_mm": 0.5,
        "sim_steps_per_motion_s": 4000.0,
        "wall_s_per_motion_s": 1.5,
        "cpu_s_per_motion_s": 1.2,
        "seconds": 3.8,
    }


def test_the_table_of_results_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[str, str]] = []

    def retarget(clip: str, body: str, **_: Any) -> SimpleNamespace:
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append((clip, body))
        return SimpleNamespace(metrics=metrics(7.04))

    monkeypatch.setattr(table.physique, "retarget", retarget)
    monkeypatch.setattr(table, "ROWS", {"walk": table.ROWS["walk"]})
    monkeypatch.setattr(sys, "argv", ["run.py", "--out", str(tmp_path), "--write", str(tmp_path / "page.md")])
    with pytest.raises(KeyboardInterrupt):
        table.main()
    assert asked == [("walk", "average"), ("walk", "thin")]
    asked.clear()
    table.main()
    assert asked == [("walk", "heavy")]
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    row = "| body | yes | 7.0 | 21 | 50 (60) | 0.5 | 4 | 1.5 |"
    for body in ("average", "thin", "heavy"):
        assert f"| walk | {body} {row}\n" in page


def test_the_matrix_is_made_of_stored_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = Cells(tmp_path / matrix.RESULTS)
    cells.put("walk, average", metrics(7.0), fps=None)
    cells.put("walk, heavy", {**metrics(9.0), "success": False, "lost_s": 1.2, "hardest": "com"}, fps=None)
    cells.put("roll, average", {"refused": "no floor"}, fps=None)
    monkeypatch.setattr(matrix, "pictures", lambda: np.zeros((4, 4, 3), dtype=np.uint8))
    # The row is stored for these bodies: there is nothing to run.
    monkeypatch.setattr(
        sys, "argv", ["matrix.py", "--out", str(tmp_path), "--clips", "walk", "--bodies", "average,heavy"]
    )
    matrix.main()
    assert capsys.readouterr().out == ""
    page = (tmp_path / "docs" / "matrix.md").read_text(encoding="utf-8")
    assert "| walk | 3.8 | 7 | lost at 1.2 s |" in page
    assert "| roll * | 0.0 | refused |  |" in page
    assert "versions of the code" not in page
    stored = json.loads((tmp_path / matrix.RESULTS).read_text(encoding="utf-8"))
    stored["roll, average"]["inputs"]["code"] = "earlier"
    (tmp_path / matrix.RESULTS).write_text(json.dumps(stored), encoding="utf-8")
    matrix.main()
    page = (tmp_path / "docs" / "matrix.md").read_text(encoding="utf-8")
    assert "2 versions of the code are mixed" in page

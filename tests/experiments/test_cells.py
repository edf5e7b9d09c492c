"""Cells are stored at once and hold only for what made them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from physique.errors import InputError
from physique.experiments import cells
from physique.experiments.cells import Cells, kept_run, makers


def refuse() -> None:
    raise AssertionError("it is made again")


def test_a_stopped_table_goes_on_where_it_was(tmp_path: Path) -> None:
    path = tmp_path / "new" / "table.json"
    table = Cells(path)
    assert table.make("walk", lambda: {"E": 1.5}, seed=1) == {"E": 1.5}

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        table.make("punch", stop, seed=1)
    again = Cells(path)
    assert again.make("walk", refuse, seed=1) == {"E": 1.5}
    assert again.values == {"walk": {"E": 1.5}}
    assert again.make("punch", lambda: 2, seed=1) == 2
    assert Cells(path).values == {"walk": {"E": 1.5}, "punch": 2}


def test_a_cell_of_other_inputs_or_code_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = Cells(tmp_path / "table.json")
    table.put("walk", 1, seed=1)
    assert table.has("walk", seed=1)
    assert not table.has("walk", seed=2)
    assert not table.has("walk")
    assert not table.has("punch", seed=1)
    monkeypatch.setattr(cells, "makers", lambda: {"code": "other"})
    assert table.make("walk", lambda: 2, seed=1) == 2
    assert Cells(tmp_path / "table.json").values == {"walk": 2}


def test_a_damaged_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "table.json").write_text('{"walk"')
    with pytest.raises(InputError, match="JSON"):
        Cells(tmp_path / "table.json")


def test_the_makers_are_the_code_and_the_packages() -> None:
    assert {"code", "mujoco", "numpy"} <= makers().keys()


def test_a_kept_run_is_resumed_but_where_other_code_made_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(cells, "retarget", lambda *a, **options: asked.append((*a, options)))
    for _ in range(2):
        kept_run(tmp_path / "kick", "kick", "heavy", end=1.0)
    monkeypatch.setattr(cells, "makers", lambda: {"code": "other"})
    kept_run(tmp_path / "kick", "kick", "heavy", end=1.0)
    assert asked[0] == asked[1] != asked[2]
    for clip, body, options in asked:
        assert (clip, body, options["end"], options["resume"]) == ("kick", "heavy", 1.0, True)
        assert options["out"].parent == tmp_path

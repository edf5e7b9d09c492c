"""The comparison's stored results and its report."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib.image
import pytest

import compare_optimizers
from compare_optimizers import Optimizer, merge, optimizers, run, stands
from optimizers_report import PICTURES, write_report
from physique.tracking.problem import Problem
from samplers import MppiOptions, annealed_mppi


def entry(cost: float, steps: int, **changes: object) -> dict[str, Any]:
    """A stored curve that falls to `cost` in `steps`."""
    return {
        "problem": "a",
        "done": True,
        "status": "iterations",
        "steps": [steps // 4, steps // 2, steps],
        "cost": [9 * cost, 3 * cost, cost],
        "error_mm": [50.0, 40.0, 30.4],
        "times": [1.0, 2.0, 4.0],
        "final_cost": cost,
        "final_steps": steps,
        "seconds": 12.3,
        **changes,
    }


ALL = {
    "fast": entry(2.0, 300_000),
    "paper": entry(20.0, 8_100_000, budget=200_000, done=False, status="running"),
    "cem": entry(15.0, 1_600_000, budget=1_620_000),
    "mppi": entry(11.0, 1_600_000, budget=1_620_000),
}
PLACE = {"clip": "walk", "start": 0.2, "body": "average"}


def report(tmp_path: Path, windows: dict[str, Any]) -> str:
    write_report({"windows": windows}, tmp_path)
    for y, x in PICTURES:
        image = matplotlib.image.imread(tmp_path / "images" / f"optimizers_{y}_{x}.png")
        assert image.std() > 0.01
    return (tmp_path / "optimizers.md").read_text(encoding="utf-8")


def test_report_of_all_optimizers_and_bodies(tmp_path: Path) -> None:
    text = report(
        tmp_path, {"walk": {**PLACE, **ALL}, "walk, heavy": {**PLACE, "body": "heavy", "cem": ALL["cem"]}}
    )
    lines = text.splitlines()
    assert "| walk (walk from 0.2 s) | average | fast | **2.00** | 30 | 0.3 M | 12 |  |" in lines
    # `fast` was at 18, 6 and 2.
    assert "| walk (walk from 0.2 s) | average | cem | 15.00 | 30 | 1.6 M | 12 | 0.15 M steps |" in lines
    assert any("8.1 M, so far (100,000 simulations)" in line for line in lines)
    assert 'marked "so far"' in text
    assert "- Of 1 window `fast` ends lower than `cem` on 1. E is 0.133 times that of `cem`" in text
    assert "than `paper`" not in text  # it is not done
    assert "| walk (walk from 0.2 s) | heavy | cem | **15.00** | 30 | 1.6 M | 12 |  |" in lines
    # At equal steps: a budget that ended leaves a gap, who stopped by himself does not.
    assert "| walk | average | fast |  | 18.00 | 2.00 | 2.00 | 2.00 |" in lines
    assert "| walk | average | mppi |  |  | 33.00 |  |  |" in lines


@pytest.mark.parametrize("names", [("paper",), ("cem", "mppi")])
def test_report_of_some_optimizers(tmp_path: Path, names: tuple[str, ...]) -> None:
    text = report(tmp_path, {"walk": {**PLACE, **{name: ALL[name] for name in names}}})
    table = [line.split(" | ")[2] for line in text.splitlines() if line.startswith("| walk (")]
    assert table == list(names)
    assert ('marked "so far"' in text) == ("paper" in names)
    for name in ALL:
        assert (f"- `{name}`: " in text) == (name in names)
    assert ("SPIDER" in text) == ("rivals are written anew" in text) == ("mppi" in names)
    assert ("Budget: 200,000 simulations." in text) == ("paper" in names)
    assert text.count("Budget: 1,620,000 simulated steps.") == len({"cem", "mppi"} & set(names))


def test_report_of_nothing(tmp_path: Path) -> None:
    assert "| walk" not in report(tmp_path, {"walk": PLACE})


def test_report_says_which_were_measured_on_another_body_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("optimizers_report._plot", lambda *_: None)
    walk = {**PLACE, **ALL, "cem": {**ALL["cem"], "problem": "b"}}
    write_report({"windows": {"walk": walk}}, tmp_path)
    text = (tmp_path / "optimizers.md").read_text(encoding="utf-8")
    assert r"| cem \* |" in text
    assert "not all were measured on the same version" in text


def test_only_searches_on_the_same_problem_are_set_against_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("optimizers_report._plot", lambda *_: None)
    write_report({"windows": {"walk": {**PLACE, **ALL, "cem": {**ALL["cem"], "problem": "b"}}}}, tmp_path)
    text = (tmp_path / "optimizers.md").read_text(encoding="utf-8")
    assert "than `mppi` on 1" in text
    assert "than `cem`" not in text


def test_what_is_stored_stands_until_problem_settings_or_budget_change() -> None:
    for name, optimizer in optimizers(2_000, 400_000).items():
        known = {"problem": "a", "done": True, **optimizer.settings}
        assert stands(known, "a", optimizer) == (name != "fast")
        assert not stands(known, "b", optimizer)
        assert not stands({**known, "done": False}, "a", optimizer)
        assert not stands(None, "a", optimizer)
        if name != "fast":
            assert not stands({**known, "sigma": 9.0}, "a", optimizer)
            assert not stands(known, "a", optimizers(4_000, 800_000)[name])
            assert stands(known, "a", optimizers(1_000, 200_000)[name])


def test_merge_takes_all_but_unfinished_for_finished() -> None:
    ours = {"windows": {"walk": {**PLACE, "fast": ALL["fast"], "mppi": ALL["mppi"]}}}
    theirs = {
        "windows": {
            "walk": {
                **PLACE,
                "paper": ALL["paper"],
                "fast": entry(1.0, 5),
                "mppi": entry(3.0, 7, done=False),
            },
            "kick": {**PLACE, "paper": ALL["paper"]},
        }
    }
    merge(ours, theirs)
    walk = ours["windows"]["walk"]
    assert walk["paper"] == ALL["paper"]
    assert walk["fast"]["final_cost"] == 1.0
    assert walk["mppi"] == ALL["mppi"]
    assert ours["windows"]["kick"]["paper"] == ALL["paper"]


def test_a_search_is_stored_on_the_way_and_at_its_end(
    problem: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compare_optimizers, "CHECKPOINT", 0.0)
    options = MppiOptions(samples=8, budget=900)
    search = Optimizer(asdict(options), lambda p, s, n, on, ask: annealed_mppi(p, s, n, options, on, ask))
    stored: list[dict[str, Any]] = []
    run(search, problem, 1, tmp_path, stored.append)
    assert [e["done"] for e in stored] == [False, False, False, True]
    last = json.loads(json.dumps(stored[-1]))
    assert len(last["steps"]) == len(last["cost"]) == len(last["times"]) == 3
    assert 0 < last["error_mm"][-1] < 1000
    assert last["final_cost"] == pytest.approx(last["cost"][-1], rel=1e-5)
    assert (last["budget"], last["samples"], last["status"]) == (900, 8, "budget")
    assert "M steps" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["cem", "mppi"])
def test_the_rivals_keep_to_their_budget(problem: Problem, tmp_path: Path, name: str) -> None:
    stored: list[dict[str, Any]] = []
    run(optimizers(1, 100)[name], problem, 1, tmp_path, stored.append)
    assert stored[-1]["done"]
    assert stored[-1]["final_steps"] <= 100

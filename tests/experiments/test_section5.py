"""The experiments of docs/section5.md, on a fifth of a second."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib.image
import pytest

from physique.experiments import horizon, objects, section5, torque
from physique.runs import folder
from physique.runs.run import Run

Rows = list[list[str]]


def call(experiment: object, folder: Path, capsys: pytest.CaptureFixture[str], *more: object) -> Rows:
    """The table's rows that `main` prints, without its head."""
    experiment.main(["--out", str(folder / "runs"), "--end", "0.2", *map(str, more)])
    text = capsys.readouterr().out
    head, line, *rows = [row[2:-2].split(" | ") for row in re.findall(r"\|.*\|", text)]
    assert line == ["---"] * len(head)
    assert all(len(row) == len(head) for row in rows)
    return rows


def count_runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The clips that are really retargeted from here on."""
    made: list[str] = []
    plain = folder.finish_run

    def finish(path: Path, result: Run) -> Run:
        made.append(path.name)
        return plain(path, result)

    monkeypatch.setattr(folder, "finish_run", finish)
    return made


def test_torque_limits_are_measured_kept_and_put_into_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Old\n\n## Held objects\n\nkept\n\n## Torque limits\n\nreplaced\n", encoding="utf-8")
    made = count_runs(monkeypatch)
    monkeypatch.setattr(torque, "LIMITS", (300.0, 50.0))
    rows = call(torque, tmp_path, capsys, "--write", page)
    assert [row[0] for row in rows] == ["300 Nm", "50 Nm", "reference"]
    assert all(0 <= float(row[2]) < 500 for row in rows[:2])
    assert all(50 < float(row[4]) < 2000 for row in rows)
    # Who may do more, follows more nearly.
    assert float(rows[0][2]) <= float(rows[1][2])
    text = page.read_text(encoding="utf-8")
    assert "replaced" not in text
    assert text.index("## Torque limits") < text.index("| 50 Nm") < text.index("## Held objects\n\nkept")
    assert matplotlib.image.imread(tmp_path / "images" / "section5_torque.png").std() > 0.01
    # What is there is not made again.
    assert len(made) == 2
    monkeypatch.setattr(torque, "sheet", lambda rows: None)
    assert call(torque, tmp_path, capsys) == rows
    assert len(made) == 2


def test_horizons(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(horizon, "KICKS", tmp_path / "absent.bvh")
    monkeypatch.setattr(horizon, "sheet", lambda rows: None)
    monkeypatch.setattr(horizon, "HORIZONS", (0.2,))
    rows = call(horizon, tmp_path, capsys)
    assert [row[:2] for row in rows] == [["body", "0.2 s"], ["100 Nm", "0.2 s"], ["", "reference"]]
    for row in rows[:2]:
        assert row[2] == "yes"
        assert 0 < float(row[3]) <= float(row[4]) < 500
        assert row[6] == "no"
        low, high = (float(kick) for kick in row[5].split(", "))
        assert 50 < min(low, high) < 1000


def test_held_objects_bend_who_holds_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(objects, "OWN", ((None, "body"),))
    monkeypatch.setattr(objects, "WEAK", (("stick:5kg", 50.0),))
    monkeypatch.setattr(objects, "SHOWN", ("nothing",))
    rows = call(objects, tmp_path, capsys)
    assert [row[:3] for row in rows] == [
        ["stand", "nothing", "body"],
        ["stand", "stick:5kg", "50 Nm"],
        ["walk", "nothing", "body"],
    ]
    nothing, stick = ([float(x) for x in row[4:]] for row in rows[:2])
    assert abs(nothing[2]) < 5  # the arm is level
    assert 85 < nothing[3] < 95  # and square to the trunk
    assert stick[5] > nothing[5] + 2  # Nm at the shoulder


def test_a_table_has_a_head() -> None:
    assert section5.markdown([["a", "b"], ["1", ""]]) == "| a | b |\n| --- | --- |\n| 1 |  |\n"

"""What tells runs apart, in as few words as do. Where they stand: test_gltf.py, test_usd.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from physique.render.layout import labels
from physique.runs.run import Run


def made(run: Run, body: str = "average", **options: object) -> Run:
    record = {**run.record, "identity": {**run.record["identity"], **options}}
    return replace(run, record=record, body=replace(run.body, name=body))


def test_labels_tell_runs_apart(run: Run, armed_run: Run) -> None:
    assert labels([run]) == ["average"]
    heavy, thin = made(run, "heavy"), made(run, "thin")
    assert labels([heavy, thin]) == ["heavy", "thin"]
    assert labels([heavy, made(heavy, "heavy", torque_limit=40.0)]) == [
        "heavy, own strength",
        "heavy, 40 Nm at every joint",
    ]
    assert labels([run, armed_run]) == [
        "average, empty hands",
        "average, stick of 2 kg (1 m) in the right hand",
    ]
    assert labels([heavy, made(run, "heavy", clip="kick")]) == ["walk on heavy", "kick on heavy"]
    stored = [replace(run, folder=Path(name)) for name in ("runs/a", "runs/b")]
    assert labels(stored) == ["a", "b"]
    assert labels([run, run]) == ["walk on average (1)", "walk on average (2)"]

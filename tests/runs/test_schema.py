"""Whatever is wrong with the files of a run is found at the door."""

from __future__ import annotations

import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.errors import InputError
from physique.runs.run import CHARACTER, METRICS, RECORD, TRAJECTORY, Run, finish_run, load_run
from physique.runs.schema import read_trajectory
from physique.store import read_json, write_json

NAMES = ["times", "q", "v", "control", "torque", "reference_q", "shift"]
PLACE = Path("trajectory.npz")


def damaged(run: Run, name: str, damage: str, at: int, other: str) -> dict[str, np.ndarray[Any, Any]]:
    arrays = asdict(run.trajectory)
    array = arrays[name] = arrays[name].copy()
    row = at % len(array)
    if damage == "missing":
        del arrays[name]
    elif damage == "more":
        arrays[f"{name}_{other}"] = array
    elif damage == "nan":
        array.flat[at % array.size] = np.nan
    elif damage == "infinite":
        array.flat[at % array.size] = np.inf
    elif damage == "short":
        arrays[name] = np.delete(array, row, axis=0)
    elif damage == "empty":
        arrays[name] = array[:0]
    elif damage == "flat":
        arrays[name] = array.ravel()[:, None]
    elif damage == "scalar":
        arrays[name] = np.float64(1.0)
    elif damage == "wide":
        arrays[name] = np.stack([array, array], axis=-1)
    elif damage == "text":
        arrays[name] = array.astype(str)
    elif damage == "whole":
        arrays[name] = array.astype(np.int64)
    elif damage == "half":
        arrays[name] = array.astype(np.float16)
    elif damage == "complex":
        arrays[name] = array + 1j
    elif damage == "turn":
        arrays["reference_q" if at % 2 else "q"][row, 3 + at % 4] += 0.01 + at % 3
    elif damage == "time":
        arrays["times"][max(row, 1)] += 1e-3
    return arrays


DAMAGES = "missing more nan infinite short empty flat scalar wide text whole half complex turn time"


@given(st.sampled_from(NAMES), st.sampled_from(DAMAGES.split()), st.integers(0, 10**6), st.sampled_from("ab"))
def test_damaged_arrays_are_refused(run: Run, name: str, damage: str, at: int, other: str) -> None:
    with pytest.raises(InputError, match=r"trajectory\.npz") as fault:
        read_trajectory(PLACE, damaged(run, name, damage, at, other), 0.01)
    assert "\n" not in str(fault.value)


def test_whole_arrays_are_taken(run: Run) -> None:
    read = read_trajectory(PLACE, asdict(run.trajectory), 0.01)
    assert all(np.array_equal(a, b) for a, b in zip(vars(read).values(), vars(run.trajectory).values()))
    with pytest.raises(InputError, match="other times"):
        read_trajectory(PLACE, asdict(run.trajectory), 0.02)
    # A simulation that blew up in its first window leaves the start alone.
    only = read_trajectory(PLACE, asdict(run.trajectory.beginning(1)), 0.01)
    assert only.frames == 1


@pytest.mark.parametrize(
    ("name", "change"),
    [
        (METRICS, {"windows": [{"start": 0.0}]}),
        (METRICS, {"windows": None}),
        (METRICS, {"success": "yes"}),
        (METRICS, {"seconds": None}),
        (RECORD, {"identity": {}}),
        (RECORD, {"identity": None}),
        (RECORD, {"format": "physique-run-1"}),
        (RECORD, {"status": None}),
    ],
)
def test_damaged_json_is_refused(run: Run, tmp_path: Path, name: str, change: dict[str, Any]) -> None:
    finish_run(tmp_path, run)
    assert load_run(tmp_path).success == run.success
    write_json(tmp_path / name, read_json(tmp_path / name) | change)
    with pytest.raises(InputError, match=str(tmp_path)):
        load_run(tmp_path)


def test_another_model_is_refused_by_the_file_it_is_in(run: Run, tmp_path: Path) -> None:
    finish_run(tmp_path, run)
    path = tmp_path / CHARACTER
    path.write_text(path.read_text().replace('integrator="discrete"', 'integrator="Euler"'))
    with pytest.raises(InputError, match=r"character\.xml: found other integrator"):
        load_run(tmp_path)
    path.write_text("<mujoco/>")
    with pytest.raises(InputError, match=r"character\.xml: found 0 actuators"):
        load_run(tmp_path)
    (tmp_path / TRAJECTORY).unlink()
    with pytest.raises(InputError):
        load_run(tmp_path)


@pytest.mark.parametrize("name", ["trajectory.npz", "metrics.json", "body.npz"])
def test_files_of_another_run_are_refused(run: Run, tmp_path: Path, name: str) -> None:
    folder, other = tmp_path / "one", tmp_path / "other"
    moved = replace(run.trajectory, torque=0.5 * run.trajectory.torque)
    for where, made in (
        (folder, run),
        (other, replace(run, trajectory=moved, mesh=None, metrics={**run.metrics, "wall_s": 9.0})),
    ):
        where.mkdir()
        finish_run(where, made)
        load_run(where)
    shutil.copy(other / name, folder / name)
    with pytest.raises(InputError, match=f"{name}: found a file that this run did not write"):
        load_run(folder)

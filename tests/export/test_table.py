"""The CSV: names with units, and numbers that are those of the run."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from physique.character.hinges import HINGES
from physique.export.table import write_table
from physique.runs.run import Run


def read(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    values = np.array([[float(x) if x else np.nan for x in row] for row in rows[1:]])
    assert len(set(rows[0])) == len(rows[0])
    return dict(zip(rows[0], values.T, strict=True))


def test_angles_torques_and_limits_are_those_of_the_run(run: Run, tmp_path: Path) -> None:
    table = read(write_table(tmp_path / "walk.csv", run))
    motion = run.trajectory
    np.testing.assert_allclose(table["time_s"], motion.times, atol=1e-9)
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(table[f"pelvis_{axis}_m"], motion.q[:, k], atol=1e-5)
    for i, hinge in enumerate(HINGES):
        angle = np.radians(table[f"{hinge.name}_deg"])
        np.testing.assert_allclose(angle, motion.q[:, 7 + i], atol=1e-5)
        torque, limit = table[f"{hinge.name}_torque_Nm"], table[f"{hinge.name}_limit_Nm"]
        np.testing.assert_allclose(torque[:-1], motion.torque[:, i], atol=1e-3)
        assert np.isnan(torque[-1])
        assert (np.abs(torque[:-1]) <= limit[:-1] * (1 + 1e-5)).all()
    assert not any(name.startswith("source_") for name in table)


def test_the_pelvis_faces_where_it_faces(run: Run, tmp_path: Path) -> None:
    """The angles, put together again as the conventions say, are the quaternion's rotation."""
    from scipy.spatial.transform import Rotation

    table = read(write_table(tmp_path / "walk.csv", run))
    turns = np.stack([table[f"pelvis_{name}_deg"] for name in ("rotation", "list", "tilt")], 1)
    found = Rotation.from_euler("ZXY", turns, degrees=True)
    wanted = Rotation.from_quat(run.trajectory.q[:, [4, 5, 6, 3]])
    assert (found.inv() * wanted).magnitude().max() < 1e-5


def test_the_floor_carries_the_body(run: Run, tmp_path: Path) -> None:
    table = read(write_table(tmp_path / "walk.csv", run))
    up = table["left_foot_force_z_N"] + table["right_foot_force_z_N"] + table["other_force_z_N"]
    weight = run.body.mass * 9.81
    assert 0.5 * weight < np.nanmean(up) < 1.5 * weight
    on_floor = table["left_foot_force_z_N"][:-1] > 1.0
    assert np.array_equal(np.isfinite(table["left_foot_pressure_x_m"][:-1]), on_floor)


def test_the_source_is_in_columns_of_its_own(run: Run, tmp_path: Path) -> None:
    table = read(write_table(tmp_path / "walk.csv", run, source=True))
    column = 7 + [h.name for h in HINGES].index("left_knee_y")
    wanted = np.degrees(run.trajectory.source_q[:, column])
    assert table["source_left_knee_y_deg"] == pytest.approx(wanted, abs=1e-3)

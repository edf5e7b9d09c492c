"""MJCF files: MuJoCo loads them, and their keyframes are states of the run."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from physique.errors import InputError
from physique.export.mjcf import write_mjcf
from physique.runs.run import Run


@pytest.mark.parametrize(("rate", "step"), [(None, 4), (50.0, 2), (1000.0, 1)])
def test_keys_are_the_frames_of_the_run(run: Run, tmp_path: Path, rate: float | None, step: int) -> None:
    path = write_mjcf(tmp_path / "walk.xml", run, rate=rate)
    model = mujoco.MjModel.from_xml_path(str(path))
    motion = run.trajectory
    assert model.nkey == len(motion.q[::step])
    np.testing.assert_allclose(model.key_qpos, motion.q[::step], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.key_qvel, motion.v[::step], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.key_time, motion.times[::step], rtol=0, atol=1e-9)


def test_from_a_key_its_control_leads_to_the_next_frame(run: Run, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(write_mjcf(tmp_path / "walk.xml", run)))
    data = mujoco.MjData(model)
    for key in (0, 3, model.nkey - 2):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_step(model, data)
        np.testing.assert_allclose(data.qpos, run.trajectory.q[4 * key + 1], rtol=0, atol=1e-8)


def test_the_source_takes_the_place_of_the_simulation(run: Run, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(write_mjcf(tmp_path / "s.xml", run, source=True)))
    wanted = run.trajectory.source_q[::4]
    np.testing.assert_allclose(model.key_qpos[:, :3], wanted[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.key_qpos[:, 7:], wanted[:, 7:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan")])
def test_a_rate_that_is_none_is_refused(run: Run, tmp_path: Path, rate: float) -> None:
    with pytest.raises(InputError, match="a positive number"):
        write_mjcf(tmp_path / "walk.xml", run, rate=rate)
    assert list(tmp_path.iterdir()) == []

"""AMASS files, read back by a forward kinematics of SMPL's own, with SciPy's rotations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from physique import skeleton
from physique.character import kinematics
from physique.export.amass import write_amass
from physique.runs.run import Run


def smpl_joints(file: Path) -> np.ndarray:
    """Joint positions (T, 22, 3) as SMPL has them: rest joints turned about each other, the root
    about its own rest place, then `trans`."""
    with np.load(file) as data:
        poses, trans = data["poses"].reshape(-1, 52, 3), data["trans"]
        rest, parents = data["rest_joints"], data["parents"]
    out = np.empty((len(poses), 22, 3))
    for t, pose in enumerate(poses):
        turns, places = [], []
        for joint, parent in enumerate(parents):
            turn = Rotation.from_rotvec(pose[joint])
            if parent < 0:
                turns.append(turn)
                places.append(rest[0])
                continue
            turns.append(turns[parent] * turn)
            places.append(places[parent] + turns[parent].apply(rest[joint] - rest[parent]))
        out[t] = np.array(places) + trans[t]
    return out


@pytest.mark.parametrize("source", [False, True])
def test_joints_come_back_to_a_tenth_of_a_millimetre(run: Run, tmp_path: Path, source: bool) -> None:
    file = write_amass(tmp_path / "walk.npz", run, source=source)
    q = run.trajectory.source_q if source else run.trajectory.q
    wanted = kinematics.joint_positions(run.character(), q)
    assert np.abs(smpl_joints(file) - wanted).max() < 1e-4


def test_the_file_has_what_readers_of_amass_ask_for(run: Run, tmp_path: Path) -> None:
    with np.load(write_amass(tmp_path / "walk.npz", run), allow_pickle=False) as data:
        frames = run.trajectory.frames
        assert data["poses"].shape == (frames, 156)
        assert data["trans"].shape == (frames, 3)
        assert data["mocap_framerate"] == data["mocap_frame_rate"] == 100.0
        assert str(data["gender"]) == "neutral"
        assert not data["betas"].any()
        assert not data["poses"][:, 66:].any()  # fingers
        # SMPL's rest pose: y up, left is +x, the toes before the ankles are +z.
        rest = dict(zip(skeleton.JOINTS, data["rest_joints"]))
    assert rest["head"][1] > 0.5
    assert rest["left_wrist"][0] > 0.5
    assert rest["left_foot"][2] - rest["left_ankle"][2] > 0.05

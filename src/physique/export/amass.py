"""AMASS-like npz files: SMPL-H poses and translation, and this body's own rest joints.

SMPL's rest pose has y up, z forward and x left; the file's world has z up, as AMASS. SMPL turns
the root about the rest place of the pelvis joint and adds `trans` after it, so that the pelvis is
at `rest_joints[0] + trans`. Here the rest joints are those of our body with the pelvis at the
origin, so `trans` is where the pelvis is. A reader that puts an SMPL body in place of ours has its
rest pelvis `J[0]`, some 0.2 m off the origin, to subtract from `trans`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.reference import reduced
from physique.runs.run import Run
from physique.store import PathLike, write_npz

Array = NDArray[np.float64]

#: SMPL's rest frame (x left, y up, z forward) from ours (x forward, y left, z up).
R_SMPL_FROM_REST: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
JOINTS = 52  # of SMPL-H: 22 of the body, 30 of the fingers, which stay at rest
BETAS = 16


def write_amass(path: PathLike, run: Run, *, source: bool = False) -> Path:
    """Write the simulated motion, or with `source` the source motion, as an AMASS npz file.

    poses (T, 156) rad: rotation vectors of SMPL-H's joints, each relative to its parent in SMPL's
    axes, the root's from these axes to the world. trans (T, 3) m. rest_joints (22, 3) m and
    parents (22,): the skeleton that poses and trans move. betas are zero and gender is neutral:
    the shape is not SMPL's. Raises InputError where the file cannot be written.
    """
    path = Path(path)
    q = run.trajectory.source_q if source else run.trajectory.q
    local = reduced.to_rotations(q[:, 3:7], q[:, 7:])
    vectors = rotations.log(local) @ R_SMPL_FROM_REST.T
    turn = rotations.from_matrix(R_SMPL_FROM_REST.T)
    vectors[:, 0] = rotations.log(rotations.multiply(local[:, 0], turn))
    poses = np.zeros((len(q), JOINTS, 3))
    poses[:, : len(skeleton.JOINTS)] = vectors
    rest = (run.body.joints - run.body.joints[0]) @ R_SMPL_FROM_REST.T
    rate = np.array(1.0 / run.timestep)
    write_npz(
        path,
        {
            "poses": poses.reshape(len(q), -1),
            "trans": q[:, :3],
            "betas": np.zeros(BETAS),
            "gender": np.array("neutral"),
            "mocap_framerate": rate,
            "mocap_frame_rate": rate,
            "rest_joints": rest,
            "parents": np.array(skeleton.PARENTS),
        },
    )
    return path

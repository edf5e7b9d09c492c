"""The skin follows the simulated joints: MuJoCo's own body frames are the oracle."""

from __future__ import annotations

import mujoco
import numpy as np

from physique.body.named import named_body
from physique.character.model import Character
from physique.reference.reference import Reference
from physique.render.skin import joint_transforms, skin_vertices


def test_joints_are_where_mujoco_puts_them(character: Character, walk: Reference) -> None:
    mesh = named_body("average")
    q = walk.q[::40]
    found = joint_transforms(mesh, q)
    data = mujoco.MjData(character.model)
    for t in range(len(q)):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(character.model, data)
        place = data.xpos[character.joint_bodies]
        turn = data.xmat[character.joint_bodies].reshape(-1, 3, 3)
        assert np.abs(found[t, :, :, 3] - place).max() < 1e-5  # the model's text has six digits
        assert np.abs(found[t, :, :, :3] - turn).max() < 1e-6


def test_rest_pose_is_the_mesh_itself() -> None:
    mesh = named_body("average")
    q = np.zeros((1, 57))
    q[0, :3], q[0, 3] = mesh.joints[0], 1.0
    assert np.abs(skin_vertices(mesh, q)[0] - mesh.vertices).max() < 1e-12


def test_rigid_vertices_keep_their_place_on_the_joint(walk: Reference) -> None:
    mesh = named_body("average")
    q = walk.q[:200:50]
    frames, vertices = joint_transforms(mesh, q), skin_vertices(mesh, q)
    rigid, joint = np.nonzero(mesh.weights > 1 - 1e-12)
    assert len(rigid) > 100
    local = mesh.vertices[rigid] - mesh.joints[joint]
    for t in range(len(q)):
        R, p = frames[t, joint, :, :3], frames[t, joint, :, 3]
        wanted = (R @ local[..., None])[..., 0] + p
        assert np.abs(vertices[t, rigid] - wanted).max() < 1e-9

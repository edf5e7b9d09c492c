"""Kinematics: joints, centre of mass and its Jacobian, lowest points."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from physique.body.capsule_body import Part
from physique.body.primitives import signed_distance
from physique.character.kinematics import com_velocity, poses
from physique.character.model import Character
from physique.character.state import integrate
from physique.reference.reference import Reference


def test_com_is_the_mean_of_the_parts(character: Character, walk: Reference) -> None:
    data = mujoco.MjData(character.model)
    q = walk.q[::60]
    found = poses(character, q)
    for t in range(len(q)):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(character.model, data)
        mass = character.model.body_mass[1:]
        np.testing.assert_allclose(found.com[t], mass @ data.xipos[1:] / mass.sum(), atol=1e-12)


def test_com_jacobian_by_differences(character: Character, walk: Reference) -> None:
    q = walk.q[[25, 140]]
    jacobian = poses(character, q).com_jacobian
    epsilon = 1e-6
    for i in range(56):
        d = np.zeros(56)
        d[i] = epsilon
        ahead, back = (poses(character, integrate(q, s * d)).com for s in (1, -1))
        np.testing.assert_allclose(jacobian[:, :, i], (ahead - back) / (2 * epsilon), atol=1e-8)


def test_com_velocity_is_its_rate(character: Character, walk: Reference) -> None:
    q, v = walk.q[[25, 140]], walk.v[[25, 140]]
    h = 1e-6
    rate = (poses(character, integrate(q, h * v)).com - poses(character, q).com) / h
    np.testing.assert_allclose(com_velocity(poses(character, q).com_jacobian, v), rate, atol=1e-4)


def test_lowest_points_by_search_over_the_surfaces(character: Character, walk: Reference) -> None:
    # A horizontal plane at the lowest point touches the shape: nothing below, something on it.
    model = character.model
    data = mujoco.MjData(model)
    q = walk.q[[30, 100]].copy()
    q[:, 3:7] = [[0.6, 0.8, 0, 0], [0.5, 0.5, -0.5, 0.5]]  # lying about, so that all sides count
    lowest = poses(character, q).lowest
    assert np.all(np.isinf(lowest[:, 0]))
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for t in range(len(q)):
        data.qpos[:] = q[t]
        mujoco.mj_kinematics(model, data)
        for part in character.body.parts:
            geom = model.geom(part.name)
            center = data.geom_xpos[geom.id]
            R = data.geom_xmat[geom.id].reshape(3, 3)
            surface = surface_points(part.shape, geom.size, directions)
            assert np.abs(signed_distance_local(part, geom.size, surface)).max() < 1e-9
            height = (center + surface @ R.T)[:, 2].min()
            # Samples miss the lowest point by a little, never on the other side.
            assert lowest[t, geom.id] <= height + 1e-12
            assert height - lowest[t, geom.id] < 2e-3, part.name


def surface_points(shape: str, size: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Points (N, 3) of the surface in the primitive's frame; of a box, its corners too."""
    if shape == "capsule":
        ends = np.sign(directions[:, 2:])
        return size[0] * directions + ends * np.array([0.0, 0.0, size[1]])
    if shape == "box":
        points = directions / np.abs(directions).max(axis=1, keepdims=True)
        corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        return np.concatenate([points, corners]) * size
    return directions * size


def signed_distance_local(part: Part, size: np.ndarray, points: np.ndarray) -> np.ndarray:
    """`physique.body.primitives` of the shape at the origin."""
    return signed_distance(
        replace(part, center=np.zeros(3), R_world_from_part=np.eye(3), size=np.array(size)), points
    )

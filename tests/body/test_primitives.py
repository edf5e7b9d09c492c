import numpy as np
import pytest

from physique.body.makehuman import mesh_volume
from physique.body.primitives import (
    Primitive,
    inertia,
    primitive_mesh,
    signed_distance,
    surface_samples,
    volume,
)
from physique.rotations import normalize, to_matrix

SIZES = {
    "capsule": np.array([0.07, 0.15, 0.0]),
    "box": np.array([0.1, 0.04, 0.03]),
    "ellipsoid": np.array([0.02, 0.05, 0.1]),
}


@pytest.fixture(params=SIZES)
def solid(request: pytest.FixtureRequest) -> Primitive:
    q = normalize(np.random.default_rng(3).normal(size=4))
    center = np.array([0.1, -0.2, 0.3])
    return Primitive("part", request.param, SIZES[request.param], center, to_matrix(q))


def inside(solid: Primitive) -> tuple[np.ndarray, float]:
    """Points of a fine grid inside the solid, relative to its centre, and their volume in all."""
    reach = solid.size if solid.shape != "capsule" else np.array([0.07, 0.07, 0.22])
    ticks = (np.arange(80) + 0.5) / 40.0 - 1.0
    grid = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3) * reach * 1.05
    points = grid @ solid.R_world_from_part.T
    chosen = signed_distance(solid, points + solid.center) < 0.0
    return points[chosen], float(chosen.mean() * 8.0 * np.prod(reach * 1.05))


def test_volume_is_that_of_the_inside(solid: Primitive) -> None:
    assert volume(solid) == pytest.approx(inside(solid)[1], rel=0.02)


def test_inertia_is_that_of_the_inside(solid: Primitive) -> None:
    d, _ = inside(solid)
    spread = d.T @ d / len(d)
    sampled = 3.0 * (np.trace(spread) * np.eye(3) - spread)
    assert np.abs(inertia(solid, 3.0) - sampled).max() < 0.02 * np.trace(sampled) / 3


def test_mesh_is_closed_outward_and_on_the_surface(solid: Primitive) -> None:
    vertices, faces = primitive_mesh(solid, 0.005)
    assert np.abs(signed_distance(solid, vertices)).max() < 1e-9
    centred = vertices - solid.center
    assert mesh_volume(centred, faces) == pytest.approx(volume(solid), rel=0.01)
    # The area vectors of a closed surface add up to nothing.
    a, b, c = (centred[faces[:, k]] for k in range(3))
    assert np.abs(np.cross(b - a, c - a).sum(axis=0)).max() < 1e-9


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_distance_agrees_with_the_nearest_surface_sample(shape: str) -> None:
    solid = Primitive("part", shape, SIZES[shape], np.zeros(3), np.eye(3))  # type: ignore[arg-type]
    samples, _ = surface_samples(solid, 0.003)
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (50, 3))
    nearest = np.linalg.norm(points[:, None] - samples, axis=2).min(axis=1)
    assert np.abs(np.abs(signed_distance(solid, points)) - nearest).max() < 0.003


def test_sample_areas_add_up() -> None:
    sphere = Primitive("part", "ellipsoid", np.full(3, 0.1), np.zeros(3), np.eye(3))
    _, area = surface_samples(sphere, 0.004)
    assert area.sum() == pytest.approx(4 * np.pi * 0.01, rel=0.005)

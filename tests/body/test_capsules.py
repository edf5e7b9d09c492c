from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from physique.body.build import SOFT, excluded_pairs
from physique.body.capsule_body import CapsuleBody
from physique.body.capsule_energy import CAPSULES, SIZES, Energy
from physique.body.capsules import fit_capsules
from physique.body.mesh import BodyMesh
from physique.body.primitives import Primitive, primitive_mesh, signed_distance
from physique.body.segments import FLIP, surface_points
from physique.body.surface_error import surface_error
from physique.errors import InputError
from physique.skeleton import INDEX, JOINTS, MIRROR, PARENTS

Person = Callable[[str], tuple[BodyMesh, CapsuleBody]]


# All ten are in the table of docs/bodies.md; these are its ends and its worst.
@pytest.mark.parametrize("name", ["average", "thin", "heavy", "heavy_woman", "athletic"])
def test_within_a_centimetre(person: Person, name: str) -> None:
    mesh, body = person(name)
    ours = surface_error(mesh, body.parts)
    assert ours.mean_cm <= 1.0
    assert ours.max_cm < 6.0


def test_error_of_a_surface_with_itself_and_of_a_swollen_copy() -> None:
    """A box against its own mesh, then against one larger by 1 cm on each side."""
    vertices, faces = primitive_mesh(box(0.1), 0.01)
    mesh = BodyMesh(
        "box",
        vertices,
        faces,
        np.zeros((22, 3)),
        np.ones((len(vertices), 22)) / 22,
        np.ones(len(vertices), dtype=bool),
        0.008,
        7.88,
    )
    assert surface_error(mesh, [box(0.1)]).mean_cm < 0.3
    swollen = surface_error(mesh, [box(0.11)])
    assert 0.95 < swollen.mesh_to_primitives_cm < 1.1
    # The corners stand sqrt(3) cm off; samples come close to them.
    assert 1.3 < swollen.max_cm < 1.75


def box(half: float) -> Primitive:
    return Primitive("box", "box", np.full(3, half), np.zeros(3), np.eye(3))


@pytest.mark.parametrize("name", ["average", "heavy_woman"])
def test_left_mirrors_right(person: Person, name: str) -> None:
    _, body = person(name)
    for i, j in enumerate(MIRROR):
        a, b = body.parts[i], body.parts[j]
        assert np.allclose(a.size, b.size, atol=1e-12)
        assert np.allclose(a.center, b.center * FLIP, atol=1e-12)
        assert a.mass == pytest.approx(b.mass, rel=1e-12)
        assert np.linalg.det(a.R_world_from_part) == pytest.approx(1.0)
        points = a.center + np.random.default_rng(0).normal(scale=0.1, size=(100, 3))
        assert np.allclose(signed_distance(a, points), signed_distance(b, points * FLIP))


@pytest.mark.parametrize("name", ["thin", "heavy"])
def test_feet_are_level_boxes_on_the_floor_under_the_ankle(person: Person, name: str) -> None:
    mesh, body = person(name)
    for part in ("left_ankle", "right_ankle", "left_foot", "right_foot"):
        p = body.parts[INDEX[part]]
        assert p.shape == "box"
        assert p.center[2] - p.size[2] == pytest.approx(0.0, abs=1e-9)
        assert np.allclose(p.R_world_from_part[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
        assert p.R_world_from_part[0, 0] > 0.9
    for side in ("left", "right"):
        foot = body.parts[INDEX[f"{side}_ankle"]]
        toes = body.parts[INDEX[f"{side}_foot"]]
        ankle = (mesh.joints[INDEX[f"{side}_ankle"]] - foot.center) @ foot.R_world_from_part
        assert (np.abs(ankle[:2]) < foot.size[:2]).all()
        # The two boxes meet at the ball of the foot, and together are as long as the foot.
        front = (foot.center + foot.R_world_from_part[:, 0] * foot.size[0])[0]
        back = (toes.center - toes.R_world_from_part[:, 0] * toes.size[0])[0]
        assert front == pytest.approx(back, abs=0.02)
        assert 0.13 < 2 * (foot.size[0] + toes.size[0]) / mesh.height < 0.18


def test_trunk_capsules_lie_across_and_limbs_along_their_bones(person: Person) -> None:
    for name in ("average", "thin", "heavy"):
        mesh, body = person(name)
        for i in CAPSULES:
            part, axis = body.parts[i], body.parts[i].R_world_from_part[:, 2]
            if JOINTS[i] in ("pelvis", "spine1", "spine2", "spine3"):
                assert abs(axis[1]) > 0.99
            elif JOINTS[i].endswith(("hip", "knee", "shoulder", "elbow")):
                child = mesh.joints[PARENTS.index(i)]
                bone = child - mesh.joints[i]
                assert abs(axis @ bone) / np.linalg.norm(bone) > np.cos(np.radians(15.5))
                # Not off to one side: the bone's middle lies inside the capsule.
                middle = 0.5 * (child + mesh.joints[i])
                assert signed_distance(part, middle[None])[0] < 0.0


def test_excluded_pairs_are_neighbours_and_overlaps(person: Person) -> None:
    _, body = person("heavy")
    for child, parent in enumerate(PARENTS):
        if parent >= 0:
            assert (min(child, parent), max(child, parent)) in body.excluded
    samples = [primitive_mesh(p, 0.02)[0] for p in body.parts]
    for i in range(22):
        for j in range(i + 1, 22):
            if (i, j) not in body.excluded:
                assert signed_distance(body.parts[i], samples[j]).min() > -2e-3
    assert (INDEX["left_hip"], INDEX["spine3"]) in body.excluded  # a raised thigh meets the belly
    assert (INDEX["left_knee"], INDEX["right_knee"]) not in body.excluded
    lift = np.array([0.0, 0.0, 10.0])
    apart = [replace(p, center=p.center + i * lift) for i, p in enumerate(body.parts)]
    neighbours = {(min(i, p), max(i, p)) for i, p in enumerate(PARENTS) if p >= 0}
    soft = {(min(INDEX[a], INDEX[b]), max(INDEX[a], INDEX[b])) for a, b in SOFT}
    assert set(excluded_pairs(apart)) == neighbours | soft


def test_energy_derivatives(person: Person) -> None:
    """Against central differences, at a point off the optimum."""
    mesh, body = person("average")
    start = [Primitive(p.name, p.shape, p.size, p.center, p.R_world_from_part) for p in body.parts]
    energy = Energy(start, mesh, surface_points(mesh))
    rng = np.random.default_rng(0)
    x = np.concatenate([[*start[i].size[:2], 0.0, 0.0, 0.0] for i in CAPSULES])
    x = x * 1.05 + 0.01 * rng.uniform(size=len(x))
    J = energy.at(x)[1]
    assert J.shape[1] == SIZES * len(CAPSULES)
    h = 1e-7
    for k in rng.choice(len(x), 15, replace=False):
        step = np.zeros(len(x))
        step[k] = h
        plus, minus = energy.at(x + step)[0], energy.at(x - step)[0]
        difference = (plus - minus) / (2 * h)
        # The fading of hidden points is held fixed, and a nearest point may change: those few
        # residuals aside, the columns agree.
        scale = np.abs(J[:, k]).max()
        assert np.mean(np.abs(difference - J[:, k]) <= 1e-4 * scale + 1e-12) > 0.97


def test_asymmetric_mesh_keeps_its_sides(person: Person) -> None:
    mesh, _ = person("average")
    arm = mesh.weights[:, [INDEX["left_elbow"], INDEX["left_wrist"]]].sum(axis=1)
    axis = mesh.joints[INDEX["left_elbow"]]
    thick = mesh.vertices.copy()
    thick[:, [0, 2]] += 0.3 * arm[:, None] * (mesh.vertices[:, [0, 2]] - axis[[0, 2]])
    solids = fit_capsules(replace(mesh, vertices=thick))
    left, right = solids[INDEX["left_elbow"]], solids[INDEX["right_elbow"]]
    assert left.size[0] > 1.15 * right.size[0]


def test_a_part_without_skin_is_refused(person: Person) -> None:
    mesh, _ = person("average")
    weights = mesh.weights.copy()
    weights[:, INDEX["neck"]], neck = 0.0, weights[:, INDEX["neck"]].copy()
    weights[:, INDEX["head"]] += neck
    with pytest.raises(InputError, match="part neck: found no surface"):
        fit_capsules(replace(mesh, weights=weights))

from collections.abc import Callable

import numpy as np
import pytest

from physique.body.capsule_body import CapsuleBody
from physique.body.makehuman import mesh_volume
from physique.body.mass import DE_LEVA, SEGMENTS, part_masses, segment_percent
from physique.body.mesh import BodyMesh
from physique.body.named import PEOPLE
from physique.body.primitives import Primitive, primitive_mesh, volume
from physique.body.voxels import inside_points
from physique.errors import InputError
from physique.skeleton import INDEX, JOINTS

Person = Callable[[str], tuple[BodyMesh, CapsuleBody]]


def rms(name: str, masses: list[float]) -> float:
    table, percent = DE_LEVA[PEOPLE[name].sex], segment_percent(masses)
    return float(np.sqrt(np.mean([(percent[s] - table[s]) ** 2 for s in SEGMENTS])))


@pytest.mark.parametrize("name", ["average", "thin", "heavy", "heavy_woman"])
def test_nearest_bone_is_close_to_de_leva_and_the_papers_rule_is_not(person: Person, name: str) -> None:
    mesh, body = person(name)
    nearest = rms(name, [p.mass for p in body.parts])
    paper = rms(name, [p.mass for p in part_masses(mesh, body.parts, "paper")])
    assert nearest < 1.7
    assert paper > 2.0 * nearest


@pytest.mark.parametrize("rule", ["nearest", "paper"])
@pytest.mark.parametrize("name", ["average", "heavy"])
def test_masses_add_up_and_are_possible(person: Person, name: str, rule: str) -> None:
    mesh, body = person(name)
    parts = part_masses(mesh, body.parts, rule)  # type: ignore[arg-type]
    assert sum(p.mass for p in parts) == pytest.approx(mesh.mass, rel=1e-12)
    for part, label in zip(parts, JOINTS):
        assert part.mass > 0.02, label
        moments = np.linalg.eigvalsh(part.inertia)
        assert moments[0] > 0.0
        assert moments[0] + moments[1] >= moments[2]
        assert np.allclose(part.inertia, part.inertia.T)
        # No rigid piece of a body is wider than half a metre across.
        assert np.sqrt(moments[2] / part.mass) < 0.25


def test_parts_together_have_the_mass_centre_and_inertia_of_the_whole(person: Person) -> None:
    mesh, body = person("average")
    points = inside_points(mesh.vertices, mesh.faces, 0.009)
    com = sum(p.mass * p.com for p in body.parts) / body.mass
    assert np.abs(com - points.mean(axis=0)).max() < 1e-3
    d = points - points.mean(axis=0)
    spread = body.mass * d.T @ d / len(d)
    whole = np.trace(spread) * np.eye(3) - spread
    total = np.zeros((3, 3))
    for p in body.parts:
        r = p.com - com
        total += p.inertia + p.mass * (r @ r * np.eye(3) - np.outer(r, r))
    assert np.abs(total - whole).max() < 0.005 * np.trace(whole) / 3


def test_voxels_fill_the_volume_of_closed_meshes(person: Person) -> None:
    ball = Primitive("x", "ellipsoid", np.array([0.1, 0.2, 0.3]), np.array([0, 0.05, 0]), np.eye(3))
    points = inside_points(*primitive_mesh(ball, 0.01), 0.01)
    assert len(points) * 1e-6 == pytest.approx(volume(ball), rel=0.01)
    assert np.abs(points.mean(axis=0) - ball.center).max() < 1e-3
    mesh, _ = person("heavy")
    points = inside_points(mesh.vertices, mesh.faces, 0.01)
    assert len(points) * 1e-6 == pytest.approx(mesh_volume(mesh.vertices, mesh.faces), rel=0.003)


def test_overlap_counts_once(person: Person) -> None:
    a = Primitive("x", "ellipsoid", np.full(3, 0.1), np.zeros(3), np.eye(3))
    va, fa = primitive_mesh(a, 0.01)
    b = va + np.array([0.0, 0.0, 0.1])
    points = inside_points(
        np.concatenate([va, b]), np.concatenate([fa, fa + len(va)]).astype(np.int32), 0.005
    )
    # Two balls whose centres are a radius apart share 5/16 of one.
    assert len(points) * 0.005**3 == pytest.approx(volume(a) * (2 - 5 / 16), rel=0.015)


def test_papers_rule_on_two_balls(person: Person) -> None:
    """The child counts without the lens it shares with its parent: 5/16 of a ball."""
    mesh, body = person("average")
    solids = [
        Primitive(p.name, "ellipsoid", np.full(3, 0.01), np.array([0.0, 0.0, 10.0 * i]), np.eye(3))
        for i, p in enumerate(body.parts)
    ]
    hip = INDEX["left_hip"]
    solids[hip] = Primitive("left_hip", "ellipsoid", np.full(3, 0.01), np.array([0, 0, 0.01]), np.eye(3))
    right = INDEX["right_hip"]
    solids[right] = Primitive("right_hip", "ellipsoid", np.full(3, 0.01), np.array([0, 0, 0.01]), np.eye(3))
    masses = [p.mass for p in part_masses(mesh, solids, "paper")]
    assert masses[hip] / masses[0] == pytest.approx(11 / 16, abs=0.01)
    assert masses[INDEX["head"]] / masses[0] == pytest.approx(1.0, abs=1e-6)


def test_unknown_rule(person: Person) -> None:
    mesh, body = person("average")
    with pytest.raises(InputError, match="expected nearest or paper"):
        part_masses(mesh, body.parts, "guess")  # type: ignore[arg-type]

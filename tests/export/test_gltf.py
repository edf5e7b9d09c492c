"""GLB files: valid for Khronos, and skinned by a reader of its own they give the same vertices."""

from __future__ import annotations

import dataclasses
import json
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from physique import skeleton
from physique.body.primitives import primitive_mesh
from physique.errors import InputError
from physique.export.bvh import R_FILE_FROM_WORLD
from physique.export.gltf import glb_bytes, limit_weights, write_glb
from physique.render.layout import side_by_side
from physique.render.palette import SOURCE, linear_rgb, of_rgb
from physique.render.skin import joint_transforms, skin_vertices
from physique.render.surface import held_mesh, vertex_normals
from physique.runs.run import Run

WEB = Path(__file__).parents[2] / "tools" / "web"
TYPES = {5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
SHAPES = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}
Array = NDArray[Any]


class Reader:
    """What a file says, by the text of the glTF specification."""

    def __init__(self, data: bytes) -> None:
        magic, version, total = struct.unpack_from("<4sII", data)
        assert (magic, version, total) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json = json.loads(data[20 : 20 + size])
        self.buffer = data[28 + size :]

    def values(self, index: int) -> Array:
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, shape = TYPES[accessor["componentType"]], SHAPES[accessor["type"]]
        count = accessor["count"] * int(np.prod(shape, initial=1))
        flat = np.frombuffer(self.buffer, kind, count, view["byteOffset"])
        values = flat.reshape(accessor["count"], *shape).astype(float)
        if accessor.get("normalized"):
            values /= np.iinfo(kind).max
        return values.swapaxes(1, 2) if accessor["type"] == "MAT4" else values

    def world(self, at: float) -> Array:
        """(N, 4, 4) of all nodes at a time in s."""
        nodes = self.json["nodes"]
        local = np.tile(np.eye(4), (len(nodes), 1, 1))
        for i, node in enumerate(nodes):
            local[i, :3, 3] = node.get("translation", [0, 0, 0])
        for channel in self.json["animations"][0]["channels"]:
            sampler = self.json["animations"][0]["samplers"][channel["sampler"]]
            times, output = self.values(sampler["input"]), self.values(sampler["output"])
            t = np.clip(at, times[0], times[-1])
            node = channel["target"]["node"]
            if channel["target"]["path"] == "rotation":
                turn = Slerp(times, Rotation.from_quat(output))(t)
                local[node, :3, :3] = turn.as_matrix()
            else:
                local[node, :3, 3] = [np.interp(t, times, column) for column in output.T]
        parent = {c: i for i, node in enumerate(nodes) for c in node.get("children", [])}

        def of(i: int) -> Array:
            return of(parent[i]) @ local[i] if i in parent else local[i]

        return np.array([of(i) for i in range(len(nodes))])

    def skinned(self, name: str, at: float) -> Array:
        """World vertices (V, 3) of a skinned mesh, in physique's axes."""
        node = next(n for n in self.json["nodes"] if n.get("name") == name)
        skin = self.json["skins"][node["skin"]]
        attributes = self.json["meshes"][node["mesh"]]["primitives"][0]["attributes"]
        get = {key: self.values(index) for key, index in attributes.items()}
        moves = self.world(at)[skin["joints"]] @ self.values(skin["inverseBindMatrices"])
        blend = np.einsum("vk,vkij->vij", get["WEIGHTS_0"], moves[get["JOINTS_0"].astype(int)])
        points = np.c_[get["POSITION"], np.ones(len(get["POSITION"]))]
        return np.einsum("vij,vj->vi", blend, points)[:, :3] @ R_FILE_FROM_WORLD


def family(run: Run) -> list[Run]:
    heavy = dataclasses.replace(run.body, name="heavy")
    return [run, dataclasses.replace(run, body=heavy)]


def test_vertices_of_the_file_are_those_of_the_skin(run: Run) -> None:
    assert run.mesh is not None
    reader = Reader(glb_bytes([run], source=True))
    few = (run.mesh.weights > 0).sum(axis=1) <= 4
    for name, q in (
        (f"{run.name}, skin", run.trajectory.q),
        (f"{run.name}, source, skin", run.trajectory.source_q),
    ):
        for frame in (0, 23, 50):
            found = reader.skinned(name, frame * 0.01)
            wanted = skin_vertices(run.mesh, q[frame : frame + 1])[0]
            error = np.linalg.norm(found - wanted, axis=1)
            assert error[few].max() < 1e-4
            # 3 % of the vertices, at armpits and groin, follow five joints or more.
            assert np.sqrt(np.mean(error**2)) < 1e-3
            assert error.max() < 2e-2


def test_capsules_follow_their_joints(run: Run) -> None:
    reader = Reader(glb_bytes([run], surface="capsules"))
    assert "skins" not in reader.json
    assert run.mesh is not None
    world = reader.world(0.2)
    placed = joint_transforms(run.mesh, run.trajectory.q[20:21])[0]
    for joint, part, rest, place in zip(
        skeleton.JOINTS, run.body.parts, run.body.joints, placed, strict=True
    ):
        found = next(i for i, n in enumerate(reader.json["nodes"]) if n["name"] == f"capsule {joint}")
        mesh = reader.json["meshes"][reader.json["nodes"][found]["mesh"]]
        local = reader.values(mesh["primitives"][0]["attributes"]["POSITION"])
        points = (local @ world[found, :3, :3].T + world[found, :3, 3]) @ R_FILE_FROM_WORLD
        vertices, _ = primitive_mesh(part, 0.035)
        wanted = (vertices - rest) @ place[:, :3].T + place[:, 3]
        assert np.abs(points - wanted).max() < 1e-4


@pytest.mark.parametrize("surface", ["skin", "capsules", "both"])
def test_a_stick_follows_the_wrist(armed_run: Run, surface: Any) -> None:
    reader = Reader(glb_bytes([armed_run], source=True, surface=surface))
    (geom,) = armed_run.held()
    vertices, _ = held_mesh(geom, 0.035)
    sticks = [i for i, node in enumerate(reader.json["nodes"]) if node["name"] == "held_right"]
    assert len(sticks) == 2
    colours = []
    for node, q in zip(sticks, (armed_run.trajectory.q, armed_run.trajectory.source_q)):
        (primitive,) = reader.json["meshes"][reader.json["nodes"][node]["mesh"]]["primitives"]
        local = reader.values(primitive["attributes"]["POSITION"])
        for frame in (0, 30, 50):
            world = reader.world(frame * 0.01)[node]
            points = (local @ world[:3, :3].T + world[:3, 3]) @ R_FILE_FROM_WORLD
            wrist = joint_transforms(armed_run.body, q[frame : frame + 1])[0, geom.joint]
            assert np.abs(points - (vertices @ wrist[:, :3].T + wrist[:, 3])).max() < 1e-4
        colours.append(reader.json["materials"][primitive["material"]]["name"])
    assert colours == [of_rgb(geom.rgb), SOURCE]


def test_several_runs_stand_beside_each_other(run: Run) -> None:
    runs = family(run)
    reader = Reader(glb_bytes(runs))
    shifts = side_by_side(runs)
    spans = []
    for run, shift in zip(runs, shifts, strict=True):
        found = reader.skinned(f"{run.name}, skin", 0.3)
        assert run.mesh is not None
        wanted = skin_vertices(run.mesh, run.trajectory.q[30:31])[0] + shift
        assert np.median(np.linalg.norm(found - wanted, axis=1)) < 1e-5
        spans.append((found[:, 1].min(), found[:, 1].max()))
    assert spans[0][1] < spans[1][0]
    assert side_by_side(runs[:1]).tolist() == [[0, 0, 0]]


def test_compact_files_of_fewer_frames_show_the_same_motion(run: Run) -> None:
    whole, small = glb_bytes([run]), glb_bytes([run], compact=True, keep_every=4)
    assert len(small) < len(whole)
    name = f"{run.name}, skin"
    for at in (0.0, 0.24, 0.5):  # the last frame is kept, though 50 is not divisible by 4
        error = Reader(whole).skinned(name, at) - Reader(small).skinned(name, at)
        assert np.abs(error).max() < 3e-4


def test_a_body_without_skin_is_refused_unless_capsules_are_asked_for(run: Run, tmp_path: Path) -> None:
    bare = dataclasses.replace(run, mesh=None)
    with pytest.raises(InputError, match="without a skin"):
        write_glb(tmp_path / "a.glb", [bare])
    assert list(tmp_path.iterdir()) == []
    assert write_glb(tmp_path / "a.glb", [bare], capsules=True).stat().st_size > 1000
    with pytest.raises(InputError, match="no run"):
        glb_bytes([])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 22))
def test_weights_are_the_four_largest_and_sum_to_one(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    weights = random.dirichlet(np.full(count, 0.3), size=20) @ np.eye(22)[random.permutation(22)][:count]
    joints, stored = limit_weights(weights)
    assert (stored.sum(axis=1, dtype=int) == 65535).all()
    assert (joints[stored == 0] == 0).all()
    kept = -np.sort(-weights, axis=1)[:, :4]
    wanted = kept / kept.sum(axis=1, keepdims=True)
    assert np.abs(stored / 65535 - wanted).max() < 2 / 65535
    taken = np.take_along_axis(weights, joints.astype(int), axis=1)
    assert np.abs(np.where(stored > 0, taken - kept, 0)).max() < 1e-12


def test_normals_of_a_ball_point_outward(run: Run) -> None:
    ball = dataclasses.replace(
        run.body.parts[20], shape="ellipsoid", size=np.full(3, 0.1), center=np.zeros(3)
    )
    vertices, faces = primitive_mesh(ball, 0.01)
    assert np.abs(vertex_normals(vertices, faces) - vertices / 0.1).max() < 0.02


def test_colours_are_linear_in_the_file() -> None:
    assert linear_rgb("#ff8000") == pytest.approx([1.0, 0.2158605, 0.0], abs=1e-6)


def test_another_reader_finds_the_body_upright_and_in_metres(run: Run, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load_scene(write_glb(tmp_path / "a.glb", [run], source=True))
    assert run.mesh is not None
    assert len(scene.geometry) == 2
    for mesh in scene.geometry.values():
        assert len(mesh.faces) == len(run.mesh.faces)
        assert mesh.volume == pytest.approx(
            trimesh.Trimesh(run.mesh.vertices, run.mesh.faces, process=False).volume, rel=1e-4
        )
        assert mesh.bounds[:, 1] == pytest.approx([0, run.body.height], abs=0.01)
        assert np.ptp(mesh.bounds[:, 0]) > 1.4  # the arms stretch out sideways


def test_the_khronos_validator_finds_nothing(run: Run, armed_run: Run, tmp_path: Path) -> None:
    if shutil.which("node") is None:
        pytest.skip("needs Node.js")
    if not (WEB / "node_modules" / "gltf-validator").is_dir():
        pytest.skip("needs the gltf-validator package: npm ci in tools/web")
    runs = [*family(run), armed_run]
    files = [
        write_glb(tmp_path / "one.glb", runs[:1]),
        write_glb(tmp_path / "all.glb", runs, source=True),
        write_glb(tmp_path / "capsules.glb", runs, source=True, capsules=True),
    ]
    small = tmp_path / "small.glb"
    small.write_bytes(glb_bytes(runs, source=True, surface="both", keep_every=3, compact=True))
    done = subprocess.run(
        ["node", WEB / "validate_gltf.mjs", *files, small], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    reports = json.loads(done.stdout)
    assert len(reports) == 4
    for report in reports:
        issues = report["issues"]
        assert [issues[f"num{k}"] for k in ("Errors", "Warnings", "Infos", "Hints")] == [0] * 4
    (stick,) = armed_run.held()
    vertices = 3 * len(run.mesh.vertices) + len(held_mesh(stick, 0.035)[0])  # type: ignore[union-attr]
    assert reports[1]["info"]["totalVertexCount"] == 2 * vertices

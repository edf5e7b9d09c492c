"""The embedded parametric body: MakeHuman's CC0 data, evaluated in NumPy (section 3.3).

`tools/build_body_asset.py` builds the data. A shape is the base mesh plus a sum of targets whose
weights are products of the phenotype's interpolation weights, MakeHuman's own blending rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from physique.body.mesh import BodyMesh
from physique.body.tpose import leg_extension, skin_weights, t_pose
from physique.skeleton import JOINTS

Array = NDArray[np.float64]

#: kg/m3, of the whole body, lungs included.
DENSITY = 985.0
#: Years of the age targets: child, young, old.
AGES = (10.0, 25.0, 90.0)


@dataclass(frozen=True)
class Phenotype:
    """Where a shape lies between MakeHuman's extremes; 0.5 is the middle but for sex and age.

    sex: 0 male, 1 female. age: years, 10 to 90. muscle, weight, height, proportions: 0 to 1;
    values outside extrapolate linearly.
    """

    sex: float = 0.0
    age: float = 25.0
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.5
    proportions: float = 0.5


@dataclass(frozen=True)
class Asset:
    """The data file, unpacked; N rows are the left half of the body, then the rig's points.

    template: (N, 3) m, A-pose. targets: (K, N, 3) m. race (3, 2), universal (3, 2, 3, 3), height
    and proportions (3, 2, 3, 3, 2): number of the target for age, sex, muscle, weight, option.
    row, mirrored: (V,) and (P,) parts, where each vertex and each point comes from.
    faces: (F, 3). points: P names, joints and hand landmarks. bones: B names; weights: (V, B).
    surface: (V,) bool.
    """

    template: NDArray[np.float32]
    targets: NDArray[np.float32]
    race: NDArray[np.uint8]
    universal: NDArray[np.uint8]
    height: NDArray[np.uint8]
    proportions: NDArray[np.uint8]
    row: NDArray[np.int64]
    mirrored: NDArray[np.bool_]
    faces: NDArray[np.int32]
    points: tuple[str, ...]
    bones: tuple[str, ...]
    weights: Array
    surface: NDArray[np.bool_]

    @property
    def vertices(self) -> int:
        """Number of mesh vertices V; rows of a shape after these are the points."""
        return len(self.weights)


@cache
def asset() -> Asset:
    """The embedded data, read once."""
    file = resources.files("physique.body") / "data" / "makehuman.npz"
    with resources.as_file(file) as path, np.load(path, allow_pickle=False) as data:
        d = {name: data[name] for name in data.files}
    names = [str(name) for name in d["point_names"]]
    half = len(d["template"]) - len(names)
    points = names + [_other_side(n) for n in names if n.startswith("left_")]
    point_row = [half + names.index(n) for n in names] + [
        half + names.index(n) for n in names if n.startswith("left_")
    ]
    row = np.concatenate([d["vertex_row"], point_row]).astype(np.int64)
    mirrored = np.concatenate(
        [d["vertex_mirrored"], [False] * len(names), [True] * (len(points) - len(names))]
    )
    bones = tuple(str(name) for name in d["bone_names"])
    left = np.zeros((half, len(bones)))
    left[d["weight_row"], d["weight_bone"]] = d["weight"]
    left /= left.sum(axis=1, keepdims=True)
    right = left[:, [bones.index(_other_side(name)) for name in bones]]
    vertex_row, vertex_mirrored = d["vertex_row"], d["vertex_mirrored"]
    return Asset(
        template=d["template"],
        targets=d["targets"].astype(np.float32) * np.float32(d["unit"]),
        race=d["race"],
        universal=d["universal"],
        height=d["height"],
        proportions=d["proportions"],
        row=row,
        mirrored=mirrored,
        faces=d["faces"].astype(np.int32),
        points=tuple(points),
        bones=bones,
        weights=np.where(vertex_mirrored[:, None], right[vertex_row], left[vertex_row]),
        surface=d["surface"][vertex_row],
    )


def shape(phenotype: Phenotype) -> tuple[Array, dict[str, Array]]:
    """A-pose vertices (V, 3) m, soles on z = 0, and the named points (3,) m of the rig."""
    data = asset()
    index, weight = _target_weights(data, phenotype)
    rows = data.template + np.tensordot(weight.astype(np.float32), data.targets[index], axes=1)
    full = rows[data.row].astype(float)
    full[data.mirrored, 1] *= -1.0
    full[:, 2] -= full[: data.vertices, 2].min()
    points = dict(zip(data.points, full[data.vertices :], strict=True))
    return full[: data.vertices], points


def stature_and_volume(phenotype: Phenotype) -> tuple[float, float]:
    """Height, m, in the T-pose and volume, m3, in the A-pose."""
    vertices, points = shape(phenotype)
    return float(vertices[:, 2].max()) + leg_extension(points), mesh_volume(vertices, asset().faces)


def body_mesh(phenotype: Phenotype, name: str) -> BodyMesh:
    """The body in the T-pose; volume and mass are those of the A-pose at 985 kg/m3."""
    data = asset()
    vertices, points = shape(phenotype)
    volume = mesh_volume(vertices, data.faces)
    posed, joints = t_pose(vertices, points, data.weights, data.bones)
    origin = np.array([*joints[JOINTS.index("pelvis"), :2], posed[data.surface, 2].min()])
    return BodyMesh(
        name=name,
        vertices=posed - origin,
        faces=data.faces,
        joints=joints - origin,
        weights=skin_weights(data.weights, data.bones),
        surface=data.surface,
        volume=volume,
        mass=DENSITY * volume,
    )


def mesh_volume(vertices: Array, faces: NDArray[np.int32]) -> float:
    """Volume, m3, of a closed mesh (V, 3), (F, 3) with outward faces."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


def _interpolation(value: float, anchors: tuple[float, ...]) -> Array:
    """Weights of the anchors at a value: linear between neighbours, extrapolated at the ends."""
    i = int(np.clip(np.searchsorted(anchors, value), 1, len(anchors) - 1))
    share = (value - anchors[i - 1]) / (anchors[i] - anchors[i - 1])
    weights = np.zeros(len(anchors))
    weights[i - 1 : i + 1] = 1.0 - share, share
    return weights


def _target_weights(data: Asset, p: Phenotype) -> tuple[NDArray[np.int64], Array]:
    """Numbers and weights of the targets that take part in a shape."""
    age = _interpolation(p.age, AGES)
    sex = np.array([1.0 - p.sex, p.sex])
    muscle = _interpolation(p.muscle, (0.0, 0.5, 1.0))
    weight = _interpolation(p.weight, (0.0, 0.5, 1.0))
    height = np.array([1.0 - p.height, p.height])
    proportions = np.array([1.0 - p.proportions, p.proportions])
    who = np.einsum("a,s->as", age, sex)
    build = np.einsum("as,m,w->asmw", who, muscle, weight)
    total = np.zeros(len(data.targets))
    np.add.at(total, data.race, who)
    np.add.at(total, data.universal, build)
    np.add.at(total, data.height, build[..., None] * height)
    np.add.at(total, data.proportions, build[..., None] * proportions)
    index = np.nonzero(total)[0]
    return index, total[index]


def _other_side(name: str) -> str:
    if name.startswith("left_"):
        return name.replace("left_", "right_", 1)
    return name.replace("right_", "left_", 1)

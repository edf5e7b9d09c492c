"""GLB files (binary glTF 2.0) of runs: skin, skeleton and animation, for Blender, engines, the web.

glTF has y up and looks at what faces +z, so all numbers are turned into that frame as they are
written (`bvh.R_FILE_FROM_WORLD`); no node does it. Joint frames are aligned with the world at rest
and so stay aligned in the file: the rotations of an animation are those of the T-pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from physique import rotations, skeleton
from physique.body.mesh import BodyMesh
from physique.body.primitives import primitive_mesh
from physique.character.hinges import AXES
from physique.errors import InputError
from physique.export.bvh import R_FILE_FROM_WORLD
from physique.export.glb import INDICES, VERTICES, Document
from physique.reference import reduced
from physique.render import palette
from physique.render.layout import side_by_side
from physique.render.surface import held_mesh, skin_of, vertex_normals
from physique.runs.run import Run
from physique.store import PathLike, write_atomic

Array = NDArray[np.float64]
Surface = Literal["skin", "capsules", "both"]

#: Joints that may move a vertex.
INFLUENCES = 4
_SPACING = 0.035  # m, between the vertices of a capsule
_SHORT = 32767  # 1.0 as a normalised short


@dataclass(frozen=True)
class _Look:
    """What is drawn of a body, shared by the run and its source: indices into the document.

    skin: attributes and indices of the skinned mesh, None where it is not drawn.
    capsules: of each joint's primitive, empty where they are not drawn.
    held: of each thing that a hand holds, its joint, its name and its primitive in its own colour.
    bind: accessor of the inverse bind matrices.
    """

    skin: dict[str, Any] | None
    capsules: list[dict[str, Any]]
    held: list[tuple[int, str, dict[str, Any]]]
    bind: int | None

    def ghost(self, material: int) -> _Look:
        """The same with all that is held in one material."""
        held = [(joint, name, {**shape, "material": material}) for joint, name, shape in self.held]
        return replace(self, held=held)


def write_glb(path: PathLike, runs: Sequence[Run], *, source: bool = False, capsules: bool = False) -> Path:
    """Write runs as one GLB file, side by side in one animation; `path` comes back.

    source: the source motion of each run, pale and half transparent, where it was recorded.
    capsules: the rigid shapes that were simulated in place of the skin.
    What hands hold is there either way, as nodes below the wrists.
    A vertex follows its four heaviest joints, their weights scaled to sum to 1: glTF readers need
    not know more. On the parametric body 3 % of the vertices follow more; they move by 0.5 mm on
    average in walks, dances and kicks, up to 17 mm in an armpit.
    Raises InputError where a run has no skin and its capsules are not asked for, where there is no
    run, or where the file cannot be written.
    """
    surface: Surface = "capsules" if capsules else "skin"
    data = glb_bytes(runs, source=source, surface=surface)
    path = Path(path)
    write_atomic(path, data)
    return path


def glb_bytes(
    runs: Sequence[Run],
    *,
    source: bool = False,
    surface: Surface = "skin",
    keep_every: int = 1,
    compact: bool = False,
) -> bytes:
    """The content of a GLB file of runs, see `write_glb`.

    surface: what is drawn; the nodes of capsules are called `capsule` and the joint's name, those
        of what hands hold `held_right` and `held_left`.
    keep_every: writes each so many-th frame, and the last.
    compact: rotations as normalised shorts, half the bytes, exact to 0.005 degrees.
    """
    if not runs:
        raise InputError("GLB file", "no run", "one or more runs", "name the folder of a run")
    document = Document(f"physique {version('physique')}")
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    roots: list[int] = []
    for index, (run, shift) in enumerate(zip(runs, side_by_side(runs))):
        motion = run.trajectory
        kept = np.unique(np.append(np.arange(0, motion.frames, keep_every), motion.frames - 1))
        times = document.accessor(motion.times[kept].astype(np.float32), bounds=True)
        look = _look(document, run, surface)
        takes = [(run.name, motion.q, look, _material(document, palette.body(index)))]
        if source:
            pale = _material(document, palette.SOURCE, palette.SOURCE_OPACITY)
            takes.append((f"{run.name}, source", motion.source_q, look.ghost(pale), pale))
        for name, q, shown, material in takes:
            joints, nodes = _actor(document, name, run.body.joints, shift, shown, material)
            roots += nodes
            _animate(document, q[kept], times, joints, samplers, channels, compact)
    document.add(
        "animations",
        {"name": ", ".join(run.name for run in runs), "samplers": samplers, "channels": channels},
    )
    return document.to_bytes({"name": "physique", "nodes": roots})


def limit_weights(weights: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """The four heaviest joints (V, 4) of skin weights (V, 22), and their weights of 65535 (V, 4).

    They are scaled to sum to 65535 exactly; joints without weight are joint 0.
    """
    order = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, order, axis=1)
    scaled = kept / kept.sum(axis=1, keepdims=True) * 65535
    whole = np.floor(scaled).astype(np.int64)
    # What rounding down left over goes to the largest remainders.
    missing = 65535 - whole.sum(axis=1)
    rank = np.argsort(np.argsort(whole - scaled, axis=1, kind="stable"), axis=1)
    whole += rank < missing[:, None]
    return np.where(whole > 0, order, 0).astype(np.uint8), whole.astype(np.uint16)


def _look(document: Document, run: Run, surface: Surface) -> _Look:
    skin, bind = None, None
    capsules: list[dict[str, Any]] = []
    if surface != "capsules":
        skin = _skin_primitive(document, skin_of(run))
        matrices = np.tile(np.eye(4, dtype=np.float32), (len(skeleton.JOINTS), 1, 1))
        matrices[:, :3, 3] = -(run.body.joints @ R_FILE_FROM_WORLD.T)
        bind = document.accessor(matrices)
    if surface != "skin":
        for part, joint in zip(run.body.parts, run.body.joints):
            vertices, faces = primitive_mesh(part, _SPACING)
            capsules.append(_primitive(document, vertices - joint, faces))
    held = []
    for geom in run.held():
        shape = _primitive(document, *held_mesh(geom, _SPACING))
        shape["material"] = _material(document, palette.of_rgb(geom.rgb))
        held.append((geom.joint, geom.name, shape))
    return _Look(skin, capsules, held, bind)


def _primitive(document: Document, vertices: Array, faces: NDArray[np.int32]) -> dict[str, Any]:
    normals = vertex_normals(vertices, faces)
    index_type = np.uint16 if len(vertices) < 65535 else np.uint32
    to_file = R_FILE_FROM_WORLD.T
    return {
        "attributes": {
            "POSITION": document.accessor(
                (vertices @ to_file).astype(np.float32), target=VERTICES, bounds=True
            ),
            "NORMAL": document.accessor((normals @ to_file).astype(np.float32), target=VERTICES),
        },
        "indices": document.accessor(faces.reshape(-1).astype(index_type), target=INDICES),
    }


def _skin_primitive(document: Document, mesh: BodyMesh) -> dict[str, Any]:
    primitive = _primitive(document, mesh.vertices, mesh.faces)
    joints, weights = limit_weights(mesh.weights)
    primitive["attributes"] |= {
        "JOINTS_0": document.accessor(joints, target=VERTICES),
        "WEIGHTS_0": document.accessor(weights, target=VERTICES, normalized=True),
    }
    return primitive


def _material(document: Document, srgb: str, opacity: float = 1.0) -> int:
    material: dict[str, Any] = {
        "name": srgb,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*palette.linear_rgb(srgb), opacity],
            "metallicFactor": 0,
            "roughnessFactor": 0.75,
        },
    }
    if opacity < 1:
        material["alphaMode"] = "BLEND"
    return document.add("materials", material)


def _actor(
    document: Document, name: str, rest: Array, shift: Array, look: _Look, material: int
) -> tuple[list[int], list[int]]:
    """A skeleton under a node of its own, and what it moves: its joints, the scene's new roots."""
    rest_file = rest @ R_FILE_FROM_WORLD.T
    joints = []
    for j, parent in enumerate(skeleton.PARENTS):
        offset = rest_file[j] - (rest_file[parent] if parent >= 0 else 0.0)
        joints.append(
            document.add("nodes", {"name": skeleton.JOINTS[j], "translation": (offset + 0.0).tolist()})
        )
    for j, node in enumerate(joints):
        children = [joints[i] for i, parent in enumerate(skeleton.PARENTS) if parent == j]
        rigid = [(called, shape) for joint, called, shape in look.held if joint == j]
        if look.capsules:
            shape = {**look.capsules[j], "material": material}
            rigid.append((f"capsule {skeleton.JOINTS[j]}", shape))
        for called, shape in rigid:
            mesh = document.add("meshes", {"name": called, "primitives": [shape]})
            children.append(document.add("nodes", {"name": called, "mesh": mesh}))
        if children:
            document.change("nodes", node, children=children)
    actor = document.add(
        "nodes",
        {"name": name, "translation": (R_FILE_FROM_WORLD @ shift + 0.0).tolist(), "children": [joints[0]]},
    )
    roots = [actor]
    if look.skin is not None:
        mesh = document.add("meshes", {"name": name, "primitives": [{**look.skin, "material": material}]})
        skin = document.add(
            "skins", {"name": name, "inverseBindMatrices": look.bind, "joints": joints, "skeleton": actor}
        )
        # At the top of the scene: glTF ignores the place of a skinned mesh in the tree.
        roots.append(document.add("nodes", {"name": f"{name}, skin", "mesh": mesh, "skin": skin}))
    return joints, roots


def _animate(
    document: Document,
    q: Array,
    times: int,
    joints: Sequence[int],
    samplers: list[dict[str, Any]],
    channels: list[dict[str, Any]],
    compact: bool,
) -> None:
    """Let the joints of an actor move as q (T, 57) at the stored times."""

    def channel(node: int, path: str, output: int) -> None:
        samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    place = (q[:, :3] @ R_FILE_FROM_WORLD.T).astype(np.float32)
    channel(joints[0], "translation", document.accessor(place))
    local = reduced.to_rotations(q[:, 3:7], q[:, 7:])
    for name, node, turn in zip(skeleton.JOINTS, joints, local.swapaxes(0, 1)):
        if AXES.get(name) == "":
            continue  # welded
        output = _xyzw(turn)
        if compact:
            stored = np.rint(output * _SHORT).astype(np.int16)
            accessor = document.accessor(stored, normalized=True)
        else:
            accessor = document.accessor(output.astype(np.float32))
        channel(node, "rotation", accessor)


def _xyzw(turn: Array) -> Array:
    """Quaternions wxyz (T, 4), world, as the file has them, none on the far side of the one before.

    glTF interpolates along the shorter way, but not every reader does.
    """
    q = rotations.continuous(rotations.normalize(turn))
    # The same turn seen from other axes: the axis turns, the angle stays.
    return np.concatenate([q[:, 1:] @ R_FILE_FROM_WORLD.T, q[:, :1]], axis=1)

"""A person who squats, written as BVH in whatever convention a test asks for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

# T-pose, metres: x forward, y left, z up (as physique's own), 1.70 m high.
PLACES: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "pelvis": (None, (0.0, 0.0, 0.95)),
    "spine": ("pelvis", (0.0, 0.0, 1.08)),
    "chest": ("spine", (0.0, 0.0, 1.25)),
    "neck": ("chest", (0.0, 0.0, 1.45)),
    "head": ("neck", (0.0, 0.0, 1.55)),
    "left_collar": ("chest", (0.0, 0.06, 1.40)),
    "left_shoulder": ("left_collar", (0.0, 0.18, 1.40)),
    "left_elbow": ("left_shoulder", (0.0, 0.46, 1.40)),
    "left_wrist": ("left_elbow", (0.0, 0.71, 1.40)),
    "left_hip": ("pelvis", (0.0, 0.09, 0.88)),
    "left_knee": ("left_hip", (0.0, 0.09, 0.47)),
    "left_ankle": ("left_knee", (0.0, 0.09, 0.07)),
    "left_foot": ("left_ankle", (0.13, 0.09, 0.025)),
}
for _name, (_parent, (_x, _y, _z)) in list(PLACES.items()):
    if _name.startswith("left"):
        PLACES[_name.replace("left", "right")] = (
            _parent.replace("left", "right") if _parent else None,
            (_x, -_y, _z),
        )

_SIDED = {
    "collar": "Shoulder",
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "wrist": "Hand",
    "hip": "UpLeg",
    "knee": "Leg",
    "ankle": "Foot",
    "foot": "ToeBase",
}
MIXAMO = {"pelvis": "Hips", "spine": "Spine", "chest": "Spine1", "neck": "Neck", "head": "Head"}
MIXAMO |= {
    f"{side}_{part}": side.capitalize() + name for side in ("left", "right") for part, name in _SIDED.items()
}


def squat(frames: int = 61, fps: float = 30.0) -> tuple[Array, Array]:
    """Knee flexion and arm drop (T,), rad: down and up again, at rest at both ends."""
    phase = np.linspace(0.0, 2 * np.pi, frames)
    depth = 0.5 * (1 - np.cos(phase))
    return 1.2 * depth, np.radians(70) - 0.9 * depth


@dataclass
class Convention:
    """How the squatting person is written."""

    prefix: str = ""
    names: dict[str, str] = field(default_factory=lambda: dict(MIXAMO))
    up: str = "y"
    units_per_meter: float = 100.0
    splay: float = 0.0  # rad, legs outwards in the rest pose
    arms_down: float = 0.0  # rad, of the arms in the rest pose
    heading: float = 0.0  # rad, of the person in the world
    lead_in_tpose: bool = False
    order: str = "ZXY"
    header_fps: float = 30.0
    frames: int = 61


def body_rotations(flex: float, lift: float) -> dict[str, Rotation]:
    """World rotations of a squat in body axes: shanks and thighs lean, trunk and feet do not."""
    world = {name: Rotation.identity() for name in PLACES}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        world[f"{side}_hip"] = Rotation.from_euler("y", -flex / 2)
        world[f"{side}_knee"] = Rotation.from_euler("y", flex / 2)
        arm = Rotation.from_euler("x", -sign * lift)
        for part in ("shoulder", "elbow", "wrist"):
            world[f"{side}_{part}"] = arm
    return world


def body_positions(world: dict[str, Rotation], root: Array) -> dict[str, Array]:
    """Joint positions of a pose in body axes."""
    at = {"pelvis": root}
    for name, (parent, place) in PLACES.items():
        if parent is not None:
            at[name] = at[parent] + world[parent].apply(np.subtract(place, PLACES[parent][1]))
    return at


def grounded_root(world: dict[str, Rotation]) -> Array:
    """The root that keeps the ankles over their rest places."""
    ankle = body_positions(world, np.zeros(3))["left_ankle"]
    return np.array([0.0, 0.0, PLACES["left_ankle"][1][2]]) - ankle * [1.0, 0.0, 1.0]


def write_squat(path: Path, c: Convention) -> None:
    """The squat as a BVH file in the convention."""
    # Columns: body axes (forward, left, up) in file axes; y up faces z, z up faces -y (as Blender).
    y_up = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], dtype=float)
    z_up = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], dtype=float)
    basis = Rotation.from_matrix(y_up if c.up == "y" else z_up)
    heading = Rotation.from_euler("z", c.heading)
    rest = {name: Rotation.identity() for name in PLACES}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part in ("hip", "knee", "ankle", "foot"):
            rest[f"{side}_{part}"] = Rotation.from_euler("x", sign * c.splay)
        for part in ("shoulder", "elbow", "wrist"):
            rest[f"{side}_{part}"] = Rotation.from_euler("x", -sign * c.arms_down)
    rest_at = body_positions(rest, np.array(PLACES["pelvis"][1]))

    lines: list[str] = ["HIERARCHY"]
    channels: list[str] = []

    def write(name: str, depth: int) -> None:
        parent = PLACES[name][0]
        offset = np.zeros(3) if parent is None else rest_at[name] - rest_at[parent]
        numbers = " ".join(f"{x:.9f}" for x in basis.apply(offset) * c.units_per_meter)
        pad = "  " * depth
        lines.append(f"{pad}{'JOINT' if parent else 'ROOT'} {c.prefix}{c.names[name]}")
        rotation = " ".join(f"{axis}rotation" for axis in c.order)
        head = "3" if parent else "6 Xposition Yposition Zposition"
        lines.extend([f"{pad}{{", f"{pad}  OFFSET {numbers}", f"{pad}  CHANNELS {head} {rotation}"])
        channels.append(name)
        children = [child for child, (above, _) in PLACES.items() if above == name]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.extend([f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET 0 0 0", f"{pad}  }}"])
        lines.append(f"{pad}}}")

    write("pelvis", 0)
    flex, lift = squat(c.frames)
    poses = [(*pair, heading) for pair in zip(flex, lift, strict=True)]
    if c.lead_in_tpose:
        poses.insert(0, (0.0, 0.0, Rotation.identity()))
    lines += ["MOTION", f"Frames: {len(poses)}", f"Frame Time: {1 / c.header_fps:.9f}"]
    for angle, arm, facing in poses:
        body = body_rotations(angle, arm)
        root = facing.apply(grounded_root(body)) * c.units_per_meter
        # World rotation of each joint relative to the file's rest pose, in file axes.
        world = {n: basis * facing * body[n] * rest[n].inv() * basis.inv() for n in PLACES}
        row = list(basis.apply(root))
        for name in channels:
            parent = PLACES[name][0]
            local = world[name] if parent is None else world[parent].inv() * world[name]
            row += list(local.as_euler(c.order, degrees=True))
        lines.append(" ".join(f"{x:.9f}" for x in row))
    path.write_text("\n".join(lines) + "\n")

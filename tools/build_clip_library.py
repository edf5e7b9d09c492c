"""Build src/physique/motion/data/clips.npz from the DeepMimic motions in PyPI's pybullet wheel.

    pip download --no-deps pybullet==3.2.7
    python tools/build_clip_library.py pybullet-3.2.7-*.whl

The motions are under the zlib licence of Bullet. They stay as they are, but for cyclic ones
(walk, run), which hold one cycle and are repeated, each cycle placed where the last one ended.
"""

from __future__ import annotations

import argparse
import json
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from physique import rotations as rot

Array = NDArray[np.float64]

FOLDER = "pybullet_data/data/motions/"
TARGET = Path(__file__).parent.parent / "src/physique/motion/data/clips.npz"
ORIGIN = "DeepMimic (Peng et al. 2018), from pybullet 3.2.7, zlib licence"

# pybullet_data/humanoid/humanoid.urdf, which is four times life size. Toes stand at the front
# third of the box that is the foot, 2.5 cm over its sole.
SCALE = 0.25
JOINTS: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "root": (None, (0, 0, 0)),
    "chest": ("root", (0, 0.944604, 0)),
    "neck": ("chest", (0, 0.895576, 0)),
    "right_hip": ("root", (0, 0, 0.339548)),
    "right_knee": ("right_hip", (0, -1.686184, 0)),
    "right_ankle": ("right_knee", (0, -1.63948, 0)),
    "right_toe": ("right_ankle", (0.42, -0.1, 0)),
    "right_shoulder": ("chest", (-0.0962, 0.974, 0.73244)),
    "right_elbow": ("right_shoulder", (0, -1.099152, 0)),
    "right_wrist": ("right_elbow", (0, -1.035788, 0)),
    "left_hip": ("root", (0, 0, -0.339548)),
    "left_knee": ("left_hip", (0, -1.686184, 0)),
    "left_ankle": ("left_knee", (0, -1.63948, 0)),
    "left_toe": ("left_ankle", (0.42, -0.1, 0)),
    "left_shoulder": ("chest", (-0.0962, 0.974, -0.73244)),
    "left_elbow": ("left_shoulder", (0, -1.099152, 0)),
    "left_wrist": ("left_elbow", (0, -1.035788, 0)),
}
# Columns of a frame after the duration and the root position: a quaternion, or a hinge about z.
COLUMNS = (
    "root",
    "chest",
    "neck",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_shoulder",
    "right_elbow",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_shoulder",
    "left_elbow",
)
HINGES = ("right_knee", "right_elbow", "left_knee", "left_elbow")
CYCLES = {"walk": 3, "run": 4}
LEFT_OUT = ("dance_b",)  # its feet slide throughout, at 0.5 m/s and more


def parse(text: str) -> tuple[float, Array, Array]:
    """Frames a second, root (T, 3) m, rotations (T, 13, 4) wxyz in the order of COLUMNS."""
    frames = np.array(json.loads(text)["Frames"], dtype=np.float64)
    fps = 1.0 / float(np.median(frames[:-1, 0]))
    whole = round(fps)
    fps = float(whole) if abs(fps - whole) < 1e-3 * fps else fps
    rotations = np.zeros((len(frames), len(COLUMNS), 4))
    at = 4
    for j, name in enumerate(COLUMNS):
        if name in HINGES:
            rotations[:, j, 0] = np.cos(frames[:, at] / 2)
            rotations[:, j, 3] = np.sin(frames[:, at] / 2)
            at += 1
        else:
            q = frames[:, at : at + 4]
            rotations[:, j] = q / np.linalg.norm(q, axis=1, keepdims=True)
            at += 4
    if at != frames.shape[1]:
        raise SystemExit(f"{frames.shape[1]} columns; expected {at}")
    # Durations are given a frame (roll lacks one): onto an even grid.
    times = np.concatenate([[0.0], np.cumsum(frames[:-1, 0])])
    grid = np.arange(round(times[-1] * fps) + 1) / fps
    low = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
    t = np.clip((grid - times[low]) / (times[low + 1] - times[low]), 0.0, 1.0)
    root = frames[low, 1:4] + t[:, None] * (frames[low + 1, 1:4] - frames[low, 1:4])
    steps = np.broadcast_to(t[:, None], (len(grid), len(COLUMNS)))
    return fps, root, rot.slerp(rotations[low], rotations[low + 1], steps)


def repeat(root: Array, rotations: Array, cycles: int) -> tuple[Array, Array]:
    """The cycle repeated: its last frame is the pose of its first, further along.

    What the recorded cycle lacks of closing is spread over its last 40 percent.
    """
    weight = np.clip((np.linspace(0.0, 1.0, len(root)) - 0.6) / 0.4, 0.0, 1.0)
    weight = weight**2 * (3 - 2 * weight)
    gap = rot.log(rot.multiply(rot.conjugate(rotations[-1]), rotations[0]))
    print(f"    the cycle lacks up to {np.degrees(np.linalg.norm(gap, axis=-1).max()):.0f} degrees")
    rotations = rot.multiply(rotations, rot.exp(weight[:, None, None] * gap))
    root = root.copy()
    root[:, 1] += weight * (root[0, 1] - root[-1, 1])
    step = (root[-1] - root[0]) * np.array([1.0, 0.0, 1.0])
    roots = [root[:-1] + step * i for i in range(cycles)] + [root[:1] + step * cycles]
    return np.concatenate(roots), np.concatenate([rotations[:-1]] * cycles + [rotations[:1]])


def main() -> None:
    """Write the library."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path)
    wheel = zipfile.ZipFile(parser.parse_args().wheel)
    prefix = FOLDER + "humanoid3d_"
    names = sorted(n[len(prefix) : -4] for n in wheel.namelist() if n.startswith(prefix))
    names = [name for name in names if name not in LEFT_OUT]
    clips = []
    for name in names:
        fps, root, rotations = parse(wheel.read(f"{prefix}{name}.txt").decode())
        if name in CYCLES:
            root, rotations = repeat(root, rotations, CYCLES[name])
        clips.append((fps, root, rotations))
        print(f"{name:16s} {len(root):4d} frames {fps:7.3f} fps {(len(root) - 1) / fps:5.2f} s")
    order = list(JOINTS)
    TARGET.parent.mkdir(exist_ok=True)
    np.savez_compressed(
        TARGET,
        names=np.array(names),
        fps=np.array([fps for fps, _, _ in clips]),
        frames=np.array([len(root) for _, root, _ in clips]),
        cycles=np.array([CYCLES.get(name, 1) for name in names]),
        root=np.concatenate([root for _, root, _ in clips]).astype(np.float32),
        rotations=np.concatenate([q for _, _, q in clips]).astype(np.float32),
        joints=np.array(order),
        parents=np.array([order.index(p) if p else -1 for p, _ in JOINTS.values()]),
        offsets=np.array([offset for _, offset in JOINTS.values()]) * SCALE,
        moving=np.array([order.index(name) for name in COLUMNS]),
        origin=np.array(ORIGIN),
    )
    print(f"{TARGET.name}: {TARGET.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()

"""The embedded clips, which need no download."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError, suggest
from physique.motion.clip import Clip

_DATA = "clips.npz"


@dataclass(frozen=True)
class ClipInfo:
    """One embedded clip, for listings.

    origin: where it comes from, with its licence. cycles: how often the recorded cycle is
    repeated; 1 for a clip that is played as recorded.
    """

    name: str
    seconds: float
    fps: float
    origin: str
    cycles: int


@cache
def _data() -> dict[str, NDArray[np.generic]]:
    path = resources.files("physique.motion") / "data" / _DATA
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        return {key: archive[key] for key in archive.files}


def list_clips() -> list[ClipInfo]:
    """The embedded clips, by name."""
    data = _data()
    infos = []
    for i, name in enumerate(data["names"].tolist()):
        frames, fps = int(data["frames"][i]), float(data["fps"][i])
        infos.append(ClipInfo(name, (frames - 1) / fps, fps, str(data["origin"]), int(data["cycles"][i])))
    return infos


def load_clip(name: str) -> Clip:
    """The embedded clip of that name.

    Raises InputError, listing the names, where there is none.
    """
    data = _data()
    names = data["names"].tolist()
    if name not in names:
        raise InputError(
            f"clip {name!r}",
            "no such file or embedded clip",
            f"a path or one of {', '.join(names)}",
            suggest(name, names, "correct the name"),
        )
    i = names.index(name)
    first = int(data["frames"][:i].sum())
    rows = slice(first, first + int(data["frames"][i]))
    moving = data["rotations"][rows].astype(np.float64)  # (T, M, 4)
    moving /= np.linalg.norm(moving, axis=-1, keepdims=True)
    joints = tuple(data["joints"].tolist())
    rotations = np.zeros((len(moving), len(joints), 4))
    rotations[..., 0] = 1.0
    rotations[:, data["moving"]] = np.where(moving[..., :1] < 0, -moving, moving)
    offsets = data["offsets"].astype(np.float64)
    positions = np.tile(offsets, (len(moving), 1, 1))
    positions[:, 0] = data["root"][rows]
    return Clip(
        name=name,
        source=f"{name} (embedded)",
        joints=joints,
        parents=data["parents"].astype(np.int64),
        offsets=offsets,
        rotations=rotations,
        positions=positions,
        fps=float(data["fps"][i]),
        unit=1.0,
        up="y",
    )

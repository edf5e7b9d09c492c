"""Pictures that are ready to keep: a sheet of frames, an animation, a body from front and side."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image as PillowImage

from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.errors import InputError
from physique.render.raster import Image
from physique.render.sampling import frames_at
from physique.render.scene import Scene, at_one_scale, make_actor, stage
from physique.render.surface import capsule_surface, skin_surface
from physique.store import PathLike, write_atomic

_GAP = 2  # pixels, between the pictures of a sheet
_LENS = 5.0  # degrees: from so far away that perspective hardly turns those at the sides


def strip(scenes: Sequence[Scene], n: int = 8) -> Image:
    """A sheet (h, w, 3) of n evenly spaced frames of each scene: a row a scene, all at one scale.

    A scene of fewer frames than n shows each of them once.
    Raises InputError where there is no scene, or where their pictures differ in size.
    """
    shown = at_one_scale(scenes)
    width, height = shown[0].size
    columns = max(min(n, scene.frames) for scene in shown)
    size = (len(shown) * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3)
    sheet = np.full(size, 255, dtype=np.uint8)
    for row, scene in enumerate(shown):
        frames = np.linspace(0, scene.frames - 1, min(n, scene.frames)).round().astype(int)
        for column, picture in enumerate(scene.pictures(frames.tolist())):
            top, left = row * (height + _GAP), column * (width + _GAP)
            sheet[top : top + height, left : left + width] = picture
    return sheet


def animation(path: PathLike, scene: Scene, rate: float = 20.0, *, threads: int | None = None) -> Path:
    """Write a scene as a picture that moves, at true speed, for ever; `path` comes back.

    path: ends in .webp, or in .gif, which is larger and has 256 colours a frame.
    rate: pictures a second, at most those of the scene.
    threads: that draw, all processors if left out; they change nothing in the picture.
    Raises InputError for another suffix, a rate that is not positive, or where the file cannot be
    written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".gif", ".webp"):
        raise InputError(str(path), f"suffix {path.suffix!r}", ".gif or .webp", "choose one of the two")
    frames = frames_at(scene.frames, scene.fps, rate)
    ends = np.append(frames[1:], frames[-1] + max(scene.fps / rate, 1.0)) / scene.fps
    # Both formats can count in hundredths of a second.
    lasts = 10 * np.diff(np.rint(100.0 * np.append(0.0, ends))).astype(int)  # ms
    first, *rest = (PillowImage.fromarray(p) for p in scene.pictures(frames.tolist(), threads))
    buffer = io.BytesIO()
    first.save(
        buffer, suffix[1:], save_all=True, append_images=rest, duration=lasts.tolist(), loop=0, quality=75
    )
    write_atomic(path, buffer.getvalue())
    return path


def body_picture(mesh: BodyMesh, capsules: CapsuleBody, height: int = 420) -> Image:
    """A person in the T-pose (h, w, 3): skin and capsules from the front, then both from the left.

    All four are at one scale. height: of the picture, pixels.
    """
    front, left = np.zeros((2, 1, 57))
    front[0, :4] = [*mesh.joints[0], 1.0]
    left[0, :7] = [*mesh.joints[0], np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)]
    surfaces = skin_surface(mesh), capsule_surface(capsules)
    actors = [make_actor(shown, q) for q in (front, left) for shown in surfaces]
    scene = stage(actors, 1.0, (round(2.6 * height), height), azimuth=0.0, elevation=5.0, fov=_LENS)
    return scene.picture(0, caption=False)

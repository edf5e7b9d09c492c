"""Pictures of a motion: one pose, a strip of poses, an animation. Needs no display and no GPU."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from physique.errors import InputError
from physique.render import palette
from physique.render.camera import Camera
from physique.render.raycast import Array, Image, Layer, cast
from physique.store import write_atomic

AZIMUTH, ELEVATION = 50.0, 10.0  # degrees: from before and a little to the left
_INK, _PAPER = (52, 58, 66), (255, 255, 255)


def render(
    model: mujoco.MjModel,
    qpos: ArrayLike,
    camera: Camera,
    size: tuple[int, int] = (480, 360),
    *,
    reference_qpos: ArrayLike | None = None,
    sun: ArrayLike | None = None,
) -> Image:
    """Picture (h, w, 3) of the model at qpos (nq,).

    Geoms have the colours of the model; where these do not tell left from right, geoms or bodies
    named left_... and right_... get colours that do. Planes become a chequered floor with squares
    of half a metre.
    size: (width, height), pixels.
    reference_qpos: (nq,), a second figure in grey.
    sun: (3,), direction towards the light; left out, it shines from the camera's upper left.
    """
    layers = [_pose(model, qpos, _body_colours(model))]
    if reference_qpos is not None:
        layers.append(_pose(model, reference_qpos, _reference_colours(model)))
    return cast(layers, camera, size, None if sun is None else np.asarray(sun, dtype=float))


def frame_camera(
    model: mujoco.MjModel,
    q: ArrayLike,
    size: tuple[int, int],
    *,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
    fov: float = 28.0,
) -> Camera:
    """The camera nearest to the first pose of q (T, nq) that, following the root, sees all poses.

    azimuth, elevation: degrees, as in `Camera.look_at`. The floor z = 0 is in view too.
    """
    q = _sequence(model, q, "q")
    probe = Camera.look_at(np.zeros(3), azimuth=azimuth, elevation=elevation, fov=fov)
    return probe.holding(_outline(model, q), size).follow(q[0])


def strip(
    model: mujoco.MjModel,
    q: ArrayLike,
    n: int = 8,
    *,
    fps: float | None = None,
    reference_q: ArrayLike | None = None,
    camera: Camera | None = None,
    panel: tuple[int, int] = (200, 280),
    labels: tuple[str, str] = ("reference", "simulated"),
) -> Image:
    """One picture of n evenly spaced frames of q (T, nq), side by side.

    fps: frames a second of q; labels panels with times instead of frame numbers.
    reference_q: (T, nq), shown in grey in a row above, at the same times.
    camera: follows the root over the ground; left out, it is set to hold the whole motion.
    panel: (width, height) of one frame, pixels. labels: of the two rows.
    Raises InputError where the shapes do not fit.
    """
    q = _sequence(model, q, "q")
    rows = [(q, _body_colours(model), labels[1])]
    if reference_q is not None:
        reference = _same_length(_sequence(model, reference_q, "reference_q"), q)
        rows.insert(0, (reference, _reference_colours(model), labels[0]))
    if camera is None:
        camera = frame_camera(model, np.concatenate([row[0] for row in rows]), panel)
    frames = _even(len(q), n)
    width, height = panel
    gap, head = 2, 22
    sheet = PillowImage.new(
        "RGB", (len(frames) * (width + gap) - gap, head + len(rows) * (height + gap) - gap), _PAPER
    )
    draw = ImageDraw.Draw(sheet)
    for column, frame in enumerate(frames):
        left = column * (width + gap)
        time = f"{frame / fps:.2f} s" if fps else f"frame {frame}"
        draw.text((left + width / 2, head / 2), time, _INK, _font(13), anchor="mm")
        for row, (motion, colours, label) in enumerate(rows):
            view = camera.follow(q[frame])
            image = cast([_pose(model, motion[frame], colours)], view, panel)
            top = head + row * (height + gap)
            sheet.paste(PillowImage.fromarray(image), (left, top))
            if column == 0 and len(rows) > 1:
                draw.text((left + 7, top + 6), label, _INK, _font(13))
    return np.array(sheet)


def animation(
    model: mujoco.MjModel,
    q: ArrayLike,
    fps: float,
    path: str | os.PathLike[str],
    reference_q: ArrayLike | None = None,
    *,
    camera: Camera | None = None,
    size: tuple[int, int] = (400, 300),
    rate: float = 20.0,
    threads: int | None = None,
) -> Path:
    """Write q (T, nq) as an animated picture that loops, at its true speed; `path` comes back.

    path: ends in .gif (plays everywhere) or .webp (a fifth of the size, in colours unreduced).
    reference_q: (T, nq), a second figure in grey, beside and a little behind the first.
    camera: moves along over the smoothed path of the root; left out, it holds the whole motion.
    rate: pictures a second, at most; both formats count in hundredths and thousandths of seconds.
    threads: that draw, all processors if left out; they change nothing in the picture.
    Raises InputError where the shapes do not fit, the suffix is another or the file cannot be
    written.
    """
    path = Path(path)
    if path.suffix.lower() not in (".gif", ".webp"):
        raise InputError(str(path), f"suffix {path.suffix!r}", ".gif or .webp", "choose one of the two")
    q = _sequence(model, q, "q")
    beside: Array | None = None
    if reference_q is not None:
        beside = _same_length(_sequence(model, reference_q, "reference_q"), q).copy()
    outline = _outline(model, q)
    view = camera or Camera.look_at(np.zeros(3), azimuth=AZIMUTH, elevation=ELEVATION, fov=28.0)
    centre = np.zeros(3)
    if beside is not None:
        other = _outline(model, beside)
        right, _, forward = view.axes()
        apart = float(np.clip((outline @ right).max() - (other @ right).min() + 0.15, 0.7, 2.2))
        back = np.array([forward[0], forward[1], 0.0]) / np.linalg.norm(forward[:2])
        shift = apart * right + 0.35 * back
        beside[:, :2] += shift[:2]
        centre = 0.5 * apart * right
        outline = np.concatenate([outline, other + shift]) - centre
    view = camera or view.holding(outline, size)
    step_ms = max(1000.0 / rate, 1000.0 / fps)
    step_ms = round(step_ms, -1) if path.suffix.lower() == ".gif" else round(step_ms)
    times = np.arange(0.0, (len(q) - 1) / fps + 1e-9, step_ms / 1000.0)
    frames = np.minimum(np.rint(times * fps).astype(int), len(q) - 1)
    route = gaussian_filter1d(q[:, :2], 0.25 * fps, axis=0, mode="nearest") + centre[:2]
    colours, grey = _body_colours(model), _reference_colours(model)

    def draw(frame: int) -> PillowImage.Image:
        layers = [_pose(model, q[frame], colours)]
        if beside is not None:
            layers.append(_pose(model, beside[frame], grey))
        return PillowImage.fromarray(cast(layers, view.follow(route[frame]), size))

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        pictures = list(pool.map(draw, frames))
    write_atomic(path, _encode(pictures, path.suffix.lower(), step_ms))
    return path


def _encode(pictures: Sequence[PillowImage.Image], suffix: str, step_ms: float) -> bytes:
    buffer = io.BytesIO()
    options: dict[str, Any] = {"save_all": True, "duration": int(step_ms), "loop": 0}
    if suffix == ".webp":
        options |= {"format": "WEBP", "quality": 75, "method": 2}
    else:
        palette = _palette(pictures)
        pictures = [p.quantize(palette=palette, dither=PillowImage.Dither.NONE) for p in pictures]
        options |= {"format": "GIF", "optimize": False, "disposal": 1}
    pictures[0].save(buffer, append_images=list(pictures[1:]), **options)
    return buffer.getvalue()


def _palette(pictures: Sequence[PillowImage.Image]) -> PillowImage.Image:
    """256 colours for all frames, so that nothing flickers; the figures get a fair part of them."""
    some = pictures[:: max(len(pictures) // 8, 1)]
    pixels = np.concatenate([np.asarray(p)[::2, ::2].reshape(-1, 3) for p in some])
    colours, counts = np.unique(pixels // 4, axis=0, return_counts=True)
    # By area the floor would take nearly all colours: count shades by a root of their area.
    sample = np.repeat(colours * 4 + 2, np.ceil(counts**0.4).astype(int), axis=0)
    flat = PillowImage.fromarray(sample.astype(np.uint8)[None])
    return flat.quantize(256, dither=PillowImage.Dither.NONE)


def _outline(model: mujoco.MjModel, q: Array) -> Array:
    """Points (n, 3) round all poses of q (T, nq), as seen from the floor under the root."""
    points = [_corners(model, row) - [*row[:2], 0.0] for row in q[_even(len(q), 24)]]
    return np.concatenate([*points, np.zeros((1, 3))])


def _sequence(model: mujoco.MjModel, q: ArrayLike, name: str) -> Array:
    q = np.asarray(q, dtype=float)
    if q.ndim != 2 or q.shape[1] != model.nq or len(q) == 0:
        raise InputError(name, f"shape {q.shape}", f"(frames, {model.nq})", "pass the poses of this model")
    return q


def _same_length(reference: Array, q: Array) -> Array:
    if len(reference) != len(q):
        raise InputError(
            "reference_q", f"{len(reference)} frames", f"{len(q)}", "cut both to the same frames"
        )
    return reference


def _even(count: int, n: int) -> NDArray[np.int64]:
    """n indices or fewer, evenly spaced over `count`, with the first and the last."""
    return np.unique(np.rint(np.linspace(0, count - 1, min(n, count))).astype(np.int64))


def _pose(model: mujoco.MjModel, qpos: ArrayLike, colours: Array) -> Layer:
    data = mujoco.MjData(model)
    data.qpos[:] = np.asarray(qpos, dtype=float)
    mujoco.mj_kinematics(model, data)
    return Layer(model, data, colours)


def _corners(model: mujoco.MjModel, qpos: Array) -> Array:
    """Corners (8 k, 3) of the boxes round all geoms but planes, in the world."""
    data = _pose(model, qpos, np.zeros((model.ngeom, 3))).data
    solid = np.flatnonzero(model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    local = model.geom_aabb[solid, None, :3] + signs * model.geom_aabb[solid, None, 3:]
    R = data.geom_xmat[solid].reshape(-1, 3, 3)
    return (data.geom_xpos[solid, None] + local @ R.transpose(0, 2, 1)).reshape(-1, 3)


def _body_colours(model: mujoco.MjModel) -> Array:
    colours = np.array(model.geom_rgba[:, :3], dtype=float)
    sides = np.array([_side(model, geom) for geom in range(model.ngeom)])
    left, right = colours[sides == 1], colours[sides == 2]
    if len(left) and len(right) and np.allclose(left.mean(0), right.mean(0), atol=0.02):
        return np.array([palette.rgb(colour) for colour in palette.SIDES])[sides]
    return colours


def _side(model: mujoco.MjModel, geom: int) -> int:
    """0 for the middle of the body, 1 for left, 2 for right, by name."""
    names = (model.geom(geom).name, model.body(model.geom_bodyid[geom]).name)
    for side, word in enumerate(("left", "right"), start=1):
        if any(word in name.lower() for name in names):
            return side
    return 0


def _reference_colours(model: mujoco.MjModel) -> Array:
    return np.tile(np.array(palette.rgb(palette.SOURCE)), (model.ngeom, 1))


def _font(size: float) -> Any:
    return ImageFont.load_default(size)

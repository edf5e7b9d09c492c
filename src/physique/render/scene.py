"""People on a floor, filmed: skins or shapes that follow motions, a camera that follows them.

    scene = stage_runs([load_run("out/heavy"), load_run("out/thin")], source=True)
    picture = scene.picture(40)  # (h, w, 3) bytes

`stage` makes scenes of any actors.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from physique import skeleton
from physique.errors import InputError
from physique.render import palette
from physique.render.camera import Camera
from physique.render.layout import labels
from physique.render.raster import Image, draw
from physique.render.sampling import common_timestep
from physique.render.skin import blend, joint_transforms
from physique.render.surface import Surface, surface
from physique.render.zbuffer import Triangles, triangles
from physique.runs.run import Run

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

AZIMUTH, ELEVATION, FOV = 50.0, 9.0, 28.0  # degrees: from before and a little to the left

_GAP = 0.12  # m, free between neighbours
_SAMPLES = 20  # poses at which figures are measured
_CALM = 0.25  # s, over which camera and labels are smoothed
_TAG = 0.23  # m, from the highest joint up to a label
_TAG_HEIGHT = np.array([0.0, 0.0, 0.1])  # m
_MARGIN = 1.06  # how much more than the figures a camera sees
_AHEAD = 16  # pictures that are drawn before they are taken
_INK, _HALO = (44, 50, 58), (246, 247, 248)


@dataclass(frozen=True)
class Actor:
    """One person in motion.

    transforms: (T, 22, 3, 4) m, of the joints, see `skin.joint_transforms`.
    label: text above the head. ghost: seen through, without a shadow. shift: (x, y) m, by which
        the person is moved over the floor.
    """

    surface: Surface
    transforms: Array
    label: str = ""
    ghost: bool = False
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.transforms)

    def vertices(self, frame: int) -> Array:
        """World positions (V, 3), m; after the last frame the last pose stays."""
        out = blend(self.surface, self.transforms[min(frame, self.frames - 1)])
        out[:, :2] += self.shift
        return out

    def joints(self, frames: int) -> Array:
        """World positions (frames, 22, 3), m, of the joints; the last pose stays."""
        index = np.minimum(np.arange(frames), self.frames - 1)
        return self.transforms[index, :, :, 3] + np.array([*self.shift, 0.0])


def make_actor(
    shown: Surface, q: Array, *, label: str = "", ghost: bool = False, colour: str | None = None
) -> Actor:
    """A person, `shown` as skin or shapes, at q (T, 57); in one colour, "#rrggbb", if given."""
    if colour is not None:
        shown = shown.in_colour(colour)
    return Actor(shown, joint_transforms(shown, q), label, ghost)


@dataclass(frozen=True)
class Scene:
    """Actors before a camera.

    camera: over the origin; route: (T, 2) m, where it goes, over the floor. size: (width, height)
        of pictures, pixels. fps: frames a second of all actors.
    """

    actors: tuple[Actor, ...]
    camera: Camera
    route: Array
    size: tuple[int, int]
    fps: float

    @property
    def frames(self) -> int:
        """Number of frames T, of the longest motion."""
        return len(self.route)

    def picture(self, frame: int, *, caption: bool = True) -> Image:
        """Picture (h, w, 3) of a frame. caption: with the labels and the time."""
        camera = self.camera.follow(self.route[frame])
        image = draw(
            _merged([a for a in self.actors if not a.ghost], frame),
            camera,
            self.size,
            ghost=_merged([a for a in self.actors if a.ghost], frame),
            opacity=palette.SOURCE_OPACITY,
        )
        return self._captioned(image, camera, frame) if caption else image

    def pictures(self, frames: Sequence[int], threads: int | None = None) -> Iterator[Image]:
        """Pictures of these frames, in order, a few at a time; all processors draw, or `threads`."""
        with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
            for start in range(0, len(frames), _AHEAD):
                yield from pool.map(self.picture, frames[start : start + _AHEAD])

    def _captioned(self, image: Image, camera: Camera, frame: int) -> Image:
        picture = PillowImage.fromarray(image)
        pen = ImageDraw.Draw(picture)
        height = self.size[1]
        font: Any = ImageFont.load_default(max(round(height / 28), 9))
        style: dict[str, Any] = {
            "fill": _INK,
            "font": font,
            "stroke_width": max(height // 240, 1),
            "stroke_fill": _HALO,
        }
        for actor in self.actors:
            x, y = camera.project(_tag(actor, self.frames, self.fps)[frame], self.size)
            pen.text((float(x), float(y)), actor.label, anchor="ms", **style)
        pad = height // 40
        pen.text((pad, height - pad), f"{frame / self.fps:.2f} s", anchor="ls", **style)
        return np.array(picture)


def stage(
    actors: Sequence[Actor],
    fps: float,
    size: tuple[int, int] = (640, 480),
    *,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
    fov: float = FOV,
    line_up: bool = True,
) -> Scene:
    """A scene of actors, before a camera that is as near as it can be to see all of all motions.

    fps: frames a second of all actors. size: (width, height), pixels.
    azimuth, elevation, fov: degrees, as in `Camera.look_at`.
    line_up: put them side by side across the view, from left to right; else they stay where their
        motions are.
    Raises InputError where there is no actor, or for a size that is none.
    """
    if not actors:
        raise InputError("scene", "no actors", "at least one", "pass the people to be shown")
    if min(size) < 16 or max(size) > 4096:
        raise InputError("size", f"{size[0]} x {size[1]}", "16 to 4096 pixels a side", "choose another size")
    probe = Camera.look_at(np.zeros(3), azimuth=azimuth, elevation=elevation, fov=fov)
    frames = max(actor.frames for actor in actors)
    right = probe.axes()[0]
    across = [np.stack([actor.vertices(t) for t in _some(frames)]) @ right for actor in actors]
    moves = _places(across) if line_up else np.zeros(len(actors))
    placed = tuple(
        replace(actor, shift=tuple(np.add(actor.shift, move * right[:2])))
        for actor, move in zip(actors, moves)
    )
    route = _calm(np.mean([actor.joints(frames)[:, 0, :2] for actor in placed], axis=0), fps)
    # As much is to be seen to the left of the way of the camera as to its right.
    aside = (route @ right[:2])[_some(frames), None]
    spans = np.array([(x.min(), x.max()) for x in (a + move - aside for a, move in zip(across, moves))])
    route += 0.5 * (spans[:, 0].min() + spans[:, 1].max()) * right[:2]
    return at_one_scale([Scene(placed, probe, route, size, fps)])[0]


def at_one_scale(scenes: Sequence[Scene]) -> list[Scene]:
    """Scenes before one camera that is as near as it can be to see all of all of them.

    Raises InputError where there is no scene, or where their pictures differ in size.
    """
    sizes = sorted({scene.size for scene in scenes})
    if len(sizes) != 1:
        found = ", ".join(f"{width} x {height}" for width, height in sizes) or "no scenes"
        raise InputError("scenes", found, "pictures of one size", "stage all of them with one size")
    points = np.concatenate([_seen(scene) for scene in scenes])
    return [replace(s, camera=s.camera.holding(points, s.size, margin=_MARGIN)) for s in scenes]


def stage_runs(
    runs: Sequence[Run],
    size: tuple[int, int] | None = None,
    *,
    source: bool = False,
    capsules: bool = False,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
) -> Scene:
    """A scene of runs side by side, each named where there are several.

    source: the retargeted source to the left of each run, as a pale ghost. capsules: the
        simulator's shapes in place of the skin. size: (width, height), pixels; None takes 640 x 480
        for one or two figures and 960 x 480 for more. azimuth, elevation: see `stage`.
    Raises InputError for a run without a skin, for runs of different time steps, or as `stage`.
    """
    timestep = common_timestep(runs)
    actors = []
    for index, (run, label) in enumerate(zip(runs, labels(runs))):
        shown = surface(run, capsules=capsules, colour=palette.body(index))
        motion = run.trajectory
        if source:
            actors.append(
                make_actor(shown, motion.source_q, label="source", ghost=True, colour=palette.SOURCE)
            )
        actors.append(make_actor(shown, motion.q, label=label))
    if size is None:
        size = (640, 480) if len(actors) < 3 else (960, 480)
    return stage(actors, 1.0 / timestep, size, azimuth=azimuth, elevation=elevation)


def _places(across: Sequence[Array]) -> Array:
    """How far to move each figure, so that neighbours never overlap and all are about the origin.

    across: of each, (samples, V), where its vertices are from left to right, m.
    """
    places = [0.0]
    for left, right in pairwise(across):
        apart = float((left.max(axis=1) - right.min(axis=1)).max()) + _GAP
        places.append(places[-1] + max(apart, 0.0))
    return np.array(places) - 0.5 * (places[0] + places[-1])


def _some(frames: int) -> Integers:
    """The frames at which figures are measured."""
    return np.unique(np.linspace(0, frames - 1, _SAMPLES).round().astype(np.int64))


def _seen(scene: Scene) -> Array:
    """Bodies, labels and floor (n, 3), m, as from over the route."""
    points = [np.zeros((1, 3))]
    tags = [_tag(a, scene.frames, scene.fps) + _TAG_HEIGHT for a in scene.actors if a.label]
    for t in _some(scene.frames):
        here = [actor.vertices(t) for actor in scene.actors] + [tag[t : t + 1] for tag in tags]
        points.append(np.concatenate(here) - [*scene.route[t], 0.0])
    return np.concatenate(points)


def _merged(actors: Sequence[Actor], frame: int) -> Triangles:
    return triangles([(a.vertices(frame), a.surface.faces, a.surface.colours) for a in actors])


def _calm(track: Array, fps: float) -> Array:
    out: Array = gaussian_filter1d(track, _CALM * fps, axis=0, mode="nearest")
    return out


def _tag(actor: Actor, frames: int, fps: float) -> Array:
    """Where an actor's label is (frames, 3), m, world."""
    joints = actor.joints(frames)
    top = joints[:, :, 2].max(axis=1) + _TAG
    return _calm(np.concatenate([joints[:, skeleton.INDEX["pelvis"], :2], top[:, None]], 1), fps)

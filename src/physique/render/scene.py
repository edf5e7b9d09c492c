"""People on a floor, filmed: skins or shapes that follow motions, a camera that follows them.

    scene = stage_runs([load_run("out/heavy"), load_run("out/thin")], source=True)
    picture = scene.picture(40)  # (h, w, 3) bytes

`stage` makes scenes of any actors.
"""

from __future__ import annotations

from collections.abc import Sequence
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

AZIMUTH, ELEVATION, FOV = 50.0, 9.0, 28.0  # degrees: from before and a little to the left

_GAP = 0.12  # m, free between neighbours
_SAMPLES = 20  # poses at which figures are measured
_CALM = 0.25  # s, over which camera and labels are smoothed
_TAG = 0.23  # m, from the highest joint up to a label
_TAG_HEIGHT = np.array([0.0, 0.0, 0.1])  # m
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
    line_up: bool = True,
) -> Scene:
    """A scene of actors, before a camera that is as near as it can be to see all of all motions.

    fps: frames a second of all actors. size: (width, height), pixels.
    azimuth, elevation: degrees, as in `Camera.look_at`.
    line_up: put them side by side across the view, from left to right; else they stay where their
        motions are.
    Raises InputError where there is no actor, or for a size that is none.
    """
    if not actors:
        raise InputError("scene", "no actors", "at least one", "pass the people to be shown")
    if min(size) < 16 or max(size) > 4096:
        raise InputError("size", f"{size[0]} x {size[1]}", "16 to 4096 pixels a side", "choose another size")
    probe = Camera.look_at(np.zeros(3), azimuth=azimuth, elevation=elevation, fov=FOV)
    frames = max(actor.frames for actor in actors)
    some = np.unique(np.linspace(0, frames - 1, _SAMPLES).round().astype(int))
    shapes = [np.stack([actor.vertices(t) for t in some]) for actor in actors]
    placed = list(actors)
    if line_up:
        right = probe.axes()[0]
        for i, at in enumerate(_places([shape @ right for shape in shapes])):
            move = at * right
            placed[i] = replace(actors[i], shift=tuple(np.add(actors[i].shift, move[:2])))
            shapes[i] = shapes[i] + move
    middle = np.mean([actor.joints(frames)[:, 0, :2] for actor in placed], axis=0)
    route = _calm(middle, fps)
    # Bodies and labels as seen from where the camera is, and the floor under it.
    away = np.insert(route[some], 2, 0.0, axis=1)
    outlines = [(shape - away[:, None]).reshape(-1, 3) for shape in shapes]
    tags = [_tag(a, frames, fps)[some] - away + _TAG_HEIGHT for a in placed if a.label]
    points = np.concatenate([*outlines, *tags, np.zeros((1, 3))])
    return Scene(tuple(placed), probe.holding(points, size, margin=1.06), route, size, fps)


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

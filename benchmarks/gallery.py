"""The moving pictures of docs/gallery.md, from real runs.

    python benchmarks/gallery.py [NAME ...]

retargets what is needed into out/gallery (runs that are there already are kept, runs that were
stopped go on) and writes an animated WebP a scene to docs/images/gallery. NAME: some scenes only.
What a scene needs and is not there (real clips beside the repository, a controller that answers
pushes) is said in a line, and the scene is left out.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import physique
from physique.export.sampling import frames_at
from physique.export.scene import COLOURS, GHOST, Actor, Scene, make_actor, stage
from physique.export.skin import joint_transforms
from physique.export.surface import SKIN, surface
from physique.store import prepare_folder, write_atomic

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
RUNS = ROOT / "out" / "gallery"
PICTURES = ROOT / "docs" / "images" / "gallery"
SALSA = ROOT.parent / "shared" / "mocap" / "cmu" / "bvh" / "60_01.bvh"

FPS = 100.0  # frames a second of runs
LABEL = 0.33  # m, from the highest joint up to where a label ends
MOST_BYTES = 400_000  # of a picture
QUALITIES = (85, 75, 65, 55, 45, 35)  # of WebP, the first that is small enough


class Missing(Exception):
    """What a scene needs and is not there."""


def salsa() -> Iterator[tuple[Scene, float]]:
    """One dance, three bodies."""
    if not SALSA.is_file():
        raise Missing(f"no {SALSA.name} in ../shared/mocap: see docs/gallery.md for its source")
    runs = [
        _run(f"salsa_{body}", str(SALSA), body, fps=60, start=2, end=6)
        for body in ("thin", "average", "heavy")
    ]
    yield stage(_people(runs), FPS, (720, 400), azimuth=20, elevation=5), 1.0


def crowd() -> Iterator[tuple[Scene, float]]:
    """One walk, ten bodies."""
    names = (
        "short_woman", "thin_woman", "thin", "average_woman", "average", "tall", "athletic",
        "stout", "heavy_woman", "heavy",
    )  # fmt: skip
    runs = [_run(f"walk_{body}", "walk", body, end=3.0) for body in names]
    yield stage(_people(runs), FPS, (960, 320), azimuth=25, elevation=6), 1.0


def torque() -> Iterator[tuple[Scene, float]]:
    """A kick out of a jump, three limits of torque."""
    limits = (300.0, 100.0, 50.0)
    runs = [
        _run(f"spinkick_{limit:g}", "spinkick", "heavy", torque_limit=limit) for limit in limits
    ]
    people = _people(runs, [f"{limit:g} Nm" for limit in limits])
    yield stage(people, FPS, (720, 400), azimuth=60, elevation=6), 0.5


def backflip() -> Iterator[tuple[Scene, float]]:
    """A backflip, two bodies."""
    runs = [_run(f"backflip_{body}", "backflip", body) for body in ("average", "heavy")]
    yield stage(_people(runs), FPS, (640, 400), azimuth=75, elevation=5), 0.5


#: Scenes by name: each yields what to film, one after another, and at which speed.
SCENES: dict[str, Callable[[], Iterator[tuple[Scene, float]]]] = {
    "salsa": salsa,
    "crowd": crowd,
    "torque": torque,
    "backflip": backflip,
}


def main() -> None:
    """Make the scenes that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SCENES))
    wanted = parser.parse_args().names or list(SCENES)
    for name in wanted:
        if name not in SCENES:
            parser.error(f"no scene {name!r}: one of {', '.join(SCENES)}")
    prepare_folder(PICTURES)
    for name in wanted:
        try:
            films = list(SCENES[name]())
        except Missing as lack:
            print(f"{name}: left out: {lack}", flush=True)
            continue
        path = PICTURES / f"{name}.webp"
        count, quality = write_webp(path, films)
        size = path.stat().st_size / 1000
        print(f"{path.relative_to(ROOT)}: {count} pictures, quality {quality}, {size:.0f} kB",
              flush=True)  # fmt: skip


def _run(folder: str, clip: Any, body: str, **options: Any) -> physique.Run:
    """The run in out/gallery, made where it is not there yet."""
    print(f"{clip} on {body} {options or ''}", file=sys.stderr, flush=True)
    return physique.retarget(clip, body, out=RUNS / folder, resume=True, **options)


def _people(runs: Sequence[physique.Run], labels: Sequence[str] = ()) -> list[Actor]:
    """Each run's skin, in a colour of its own, named by `labels` or by body and mass."""
    labels = labels or [
        f"{run.body.name.replace('_', ' ')}, {run.body.mass:.0f} kg" for run in runs
    ]
    return [
        make_actor(
            surface(run.mesh, run.body), run.trajectory.q, label=label,
            colour=COLOURS[i % len(COLOURS)],
        )
        for i, (run, label) in enumerate(zip(runs, labels))
    ]  # fmt: skip


def _still(scene: Scene) -> Scene:
    """The scene before a camera that stays where it is, as near as it sees all of all motions.

    A floor that does not move costs a film next to nothing.
    """
    some = np.unique(np.linspace(0, scene.frames - 1, 24).round().astype(int))
    seen = [actor.vertices(t) for actor in scene.actors for t in some]
    for actor in scene.actors:
        joints = actor.joints(scene.frames)[some]
        tops = joints[..., 2].max(axis=1, keepdims=True) + LABEL
        seen.append(np.concatenate([joints[:, 0, :2], tops], axis=1))
    points = np.concatenate(seen)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) * np.array([1.0, 1.0, 0.0])
    camera = scene.camera.holding(points - middle, scene.size, margin=1.03)
    return replace(scene, camera=camera, route=np.tile(middle[:2], (scene.frames, 1)))


def write_webp(
    path: Path, films: Sequence[tuple[Scene, float]], rate: float = 100.0 / 6.0
) -> tuple[int, int]:
    """Write scenes, one after another, as an endless animation: number of pictures and quality.

    rate: pictures a second as shown; each film's second value is its speed.
    """
    pictures = []
    for scene, speed in films:
        frames = frames_at(scene.frames, scene.fps, rate / speed)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            pictures += [Image.fromarray(p) for p in pool.map(scene.picture, frames.tolist())]
    times = [round(1000 / rate)] * len(pictures)
    times[-1] = 1000  # ms: the end is looked at before it begins anew
    for quality in QUALITIES:
        buffer = io.BytesIO()
        pictures[0].save(
            buffer, "WEBP", save_all=True, append_images=pictures[1:], duration=times, loop=0,
            quality=quality, method=4, kmin=9, kmax=1000,
        )  # fmt: skip
        if buffer.tell() <= MOST_BYTES:
            break
    write_atomic(path, buffer.getvalue())
    return len(pictures), quality


if __name__ == "__main__":
    main()

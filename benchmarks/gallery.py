"""The moving pictures of docs/gallery.md, from real runs.

    python benchmarks/gallery.py [NAME ...] [--pushed RUN]

takes a quarter of an hour: retargets what is needed into out/gallery (runs that the present code
made are kept, runs that were stopped go on) and writes an animated WebP a scene to
docs/images/gallery. NAME: some scenes only. RUN: the folder of a run with the policy.npz of a tree,
for the scene `push`; out/gallery/pushed. What a scene needs and is not there (real clips beside the
repository, a controller that answers pushes) is said in a line, and the scene is left out.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import physique
from physique import skeleton
from physique.body.held import Hand
from physique.character import kinematics
from physique.character.joint_error import SUCCESS_LIMIT, joint_errors
from physique.experiments.cells import kept_run
from physique.feedback.policy import ControllerName
from physique.render.scene import Scene, stage_runs
from physique.runs.run import POLICY
from physique.simulation.session import PUSH_SECONDS, Hit, Session
from physique.store import prepare_folder, write_atomic

Array = NDArray[np.float64]
#: What to show, one after another: frames of scenes.
Film = list[tuple[Scene, int]]

ROOT = Path(__file__).resolve().parent.parent
RUNS = ROOT / "out" / "gallery"
PICTURES = ROOT / "docs" / "images" / "gallery"
SALSA = ROOT.parent / "shared" / "mocap" / "cmu" / "bvh" / "60_01.bvh"

TICK = 6  # frames of 0.01 s from one picture to the next, at true speed
MOST_BYTES = 450_000  # of a film
QUALITIES = (85, 75, 65, 55, 45, 35)  # of WebP: the first that is small enough, or the last
LABEL = 0.33  # m, from the highest joint up to where a label ends


class MissingError(Exception):
    """What a scene needs and is not there."""


def salsa() -> Film:
    """One dance, three bodies."""
    if not SALSA.is_file():
        raise MissingError(f"no {SALSA.name} in ../shared/mocap; docs/gallery.md says where it is from")
    runs = [
        _run(f"salsa_{body}", str(SALSA), body, fps=60, start=2, end=6)
        for body in ("thin", "average", "heavy")
    ]
    return _film(_stage(runs, _masses(runs), (520, 300), 5, 4, seconds=3.0))


def crowd() -> Film:
    """One walk, ten bodies."""
    names = (
        "short_woman",
        "thin_woman",
        "thin",
        "average_woman",
        "average",
        "tall",
        "athletic",
        "stout",
        "heavy_woman",
        "heavy",
    )
    runs = [_run(f"walk_{body}", "walk", body, end=3.0) for body in names]
    labels = [f"{run.body.mass:.0f} kg" for run in runs]
    return _film(_stage(runs, labels, (720, 280), 10, 6, seconds=2.1))


def torque() -> Film:
    """A kick out of a jump, three limits of torque."""
    limits = (300.0, 100.0, 50.0)
    runs = [_run(f"spinkick_{n:g}", "spinkick", "heavy", torque_limit=n) for n in limits]
    return _film(_stage(runs, [f"{n:g} Nm" for n in limits], (640, 320), 50, 6), slow=2)


def backflip() -> Film:
    """A backflip, two bodies."""
    runs = [_run(f"backflip_{body}", "backflip", body) for body in ("average", "heavy")]
    return _film(_stage(runs, _masses(runs), (560, 360), 75, 5), slow=2)


def stick() -> Film:
    """A punch, with nothing and with a stick of 5 kg in the right hand."""
    runs = [_run("punch", "punch", "average"), _held("punch", "stick:5kg", "right")]
    return _film(_stage(runs, ["nothing", "5 kg"], (560, 320), -50, 6))


def blocks() -> Film:
    """A jump, with nothing and with a block in each hand."""
    runs = [
        _run("jump", "jump", "average"),
        _held("jump", "block:10kg", "both"),
        _held("jump", "block:20kg", "both"),
    ]
    return _film(_stage(runs, ["nothing", "2 x 10 kg", "2 x 20 kg"], (560, 320), 40, 6), slow=2)


def push(folder: Path) -> Film:
    """One push, answered by LQR and by the tree of the policy in a run's folder."""
    if not (folder / POLICY).is_file():
        raise MissingError(f"no {folder / POLICY}: `physique retarget`, then `physique grow` make one")
    run = physique.load_run(folder)
    at, one, answers = _telling_push(run)
    struck, impulse = one
    strength = float(np.linalg.norm(impulse))
    print(f"push: {strength:.0f} Ns on {skeleton.JOINTS[struck.part]} at {at * run.timestep:.2f} s")
    runs = [replace(run, trajectory=replace(run.trajectory, q=q)) for q in answers.values()]
    scene = _stage(runs, list(answers), (560, 320), 40, 6)
    hit = replace(
        scene, actors=tuple(replace(a, label=f"{a.label}: {strength:.0f} Ns") for a in scene.actors)
    )
    lasts = round(4 * PUSH_SECONDS / run.timestep)  # frames that say so
    return [(hit if at <= t < at + lasts else scene, t) for _, t in _film(scene)]


#: Films by name; `push` comes to them.
SCENES: dict[str, Callable[[], Film]] = {
    "salsa": salsa,
    "crowd": crowd,
    "torque": torque,
    "backflip": backflip,
    "stick": stick,
    "blocks": blocks,
}


def main() -> None:
    """Make the films that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(SCENES)}, push")
    parser.add_argument("--pushed", type=Path, metavar="RUN", default=RUNS / "pushed")
    options = parser.parse_args()
    scenes = {**SCENES, "push": partial(push, options.pushed)}
    for name in options.names:
        if name not in scenes:
            parser.error(f"no scene {name!r}: one of {', '.join(scenes)}")
    prepare_folder(PICTURES)
    for name in options.names or scenes:
        try:
            film = scenes[name]()
        except MissingError as lack:
            print(f"{name}: left out: {lack}", flush=True)
            continue
        path = PICTURES / f"{name}.webp"
        quality = write_webp(path, film)
        size = path.stat().st_size / 1000
        print(f"{path.relative_to(ROOT)}: {len(film)} pictures, quality {quality}, {size:.0f} kB")


def write_webp(path: Path, film: Film) -> int:
    """Write a film as an endless animation; the quality, 0 to 100, that made it small enough."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        drawn = pool.map(lambda shown: Image.fromarray(shown[0].picture(shown[1])), film)
        pictures = list(drawn)
    times = [10 * TICK] * len(pictures)  # ms
    times[-1] = 1000  # the end is looked at before it begins anew
    for quality in QUALITIES:
        buffer = io.BytesIO()
        pictures[0].save(
            buffer,
            "WEBP",
            save_all=True,
            append_images=pictures[1:],
            duration=times,
            loop=0,
            quality=quality,
            method=4,
            kmin=9,
            kmax=1000,
        )
        if buffer.tell() <= MOST_BYTES:
            break
    write_atomic(path, buffer.getvalue())
    return quality


def _run(folder: str, clip: Any, body: str, **options: Any) -> physique.Run:
    """The run in out/gallery, made where it is not there yet."""
    run = kept_run(RUNS / folder, clip, body, **options)
    print(f"  error {run.metrics['mpjpe_mm']:.0f} mm, success {run.success}", file=sys.stderr)
    return run


def _held(clip: str, text: str, hand: Hand) -> physique.Run:
    """A clip on the average body with an object in a hand."""
    folder = f"{clip}_{text}".replace(":", "_")
    return _run(folder, clip, "average", hold=physique.parse_held(text, hand))


def _masses(runs: Sequence[physique.Run]) -> list[str]:
    return [f"{run.body.name}, {run.body.mass:.0f} kg" for run in runs]


def _film(scene: Scene, slow: int = 1) -> Film:
    """All of a scene, at the speed 1 / slow."""
    return [(scene, t) for t in range(0, scene.frames, TICK // slow)]


def _stage(
    runs: Sequence[physique.Run],
    labels: Sequence[str],
    size: tuple[int, int],
    azimuth: float,
    elevation: float,
    seconds: float | None = None,
) -> Scene:
    """Runs side by side, under these labels, before a camera that stays where it is.

    It is as near as it sees all that happens within `seconds`, or to the end. A floor that does not
    move costs a film nothing.
    """
    scene = stage_runs(runs, size, azimuth=azimuth, elevation=elevation)
    frames = scene.frames if seconds is None else round(seconds * scene.fps) + 1
    actors = tuple(replace(actor, label=text) for actor, text in zip(scene.actors, labels))
    some = np.unique(np.linspace(0, frames - 1, 24).round().astype(int))
    seen = [actor.vertices(t) for actor in actors for t in some]
    for actor in actors:
        joints = actor.joints(frames)[some]
        tops = joints[..., 2].max(axis=1, keepdims=True) + LABEL
        seen.append(np.concatenate([joints[:, 0, :2], tops], axis=1))
    points = np.concatenate(seen)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) * np.array([1.0, 1.0, 0.0])
    camera = scene.camera.holding(points - middle, size, margin=1.03)
    route = np.tile(middle[:2], (frames, 1))
    return replace(scene, actors=actors, camera=camera, route=route)


def _telling_push(run: physique.Run) -> tuple[int, tuple[Hit, Array], dict[str, Array]]:
    """The first of random pushes that the tree survives and LQR does not: when, what, motions."""
    rng = np.random.default_rng(0)
    frames = run.trajectory.frames
    for count in range(1, 201):
        at = int(rng.integers(frames // 8, frames // 2))
        direction = rng.normal(size=3) * np.array([1.0, 1.0, 0.2])
        impulse = rng.uniform(15.0, 60.0) * direction / np.linalg.norm(direction)
        one = Hit(skeleton.INDEX["spine3"], np.zeros(3)), impulse
        by_lqr = _answer(run, "lqr", at, one)
        if _survives(run, by_lqr):
            continue
        by_tree = _answer(run, "tree", at, one)
        if _survives(run, by_tree):
            print(f"push: number {count} of those that were drawn")
            return at, one, {"LQR": by_lqr, "tree": by_tree}
    raise MissingError("of 200 pushes there is none that the tree survives and LQR does not")


def _answer(run: physique.Run, controller: ControllerName, at: int, one: tuple[Hit, Array]) -> Array:
    """States (T, 57) of the run under a controller, pushed at a frame."""
    policy, motion = run.policy(controller), run.trajectory
    session = Session(run.character(), motion.q[0], motion.v[0])
    q = [session.q]
    for t in range(motion.frames - 1):
        if t == at:
            session.push(*one)
        session.step(policy.act(session.q, session.v))
        q.append(session.q)
    return np.array(q)


def _survives(run: physique.Run, q: Array) -> bool:
    """Whether the joints stay as near to the run's as `success` asks for, to the end."""
    joints, wanted = (kinematics.joint_positions(run.character(), x) for x in (q, run.trajectory.q))
    return bool(joint_errors(joints, wanted).mean(axis=1).max() <= SUCCESS_LIMIT)


if __name__ == "__main__":
    main()

"""The paper's section 5, as far as it is about the solver: torque limits, horizon, held objects.

    python benchmarks/section5.py --write docs/section5.md

prints three tables; with --write they and their pictures go to a page. --only torque, horizon or
objects makes one of them; the page keeps the others' parts.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import physique
from physique import rotations, skeleton
from physique.character import kinematics
from physique.character.hinges import columns
from physique.character.model import empty_handed
from physique.character.soles import sole_points
from physique.commands.bodies import write_png
from physique.motion.clip import Motion
from physique.render.picture import strip
from physique.render.scene import AZIMUTH, Scene, at_one_scale, make_actor, stage
from physique.render.surface import surface
from physique.store import write_atomic

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
KICKS = ROOT.parent / "shared" / "mocap" / "cmu" / "bvh" / "135_04.bvh"
JOINT = skeleton.INDEX
PANEL = (150, 190)  # pixels
FALLEN = 0.5  # of the standing height of the pelvis

TORQUE = """## Torque limits

The embedded `spinkick`, a kick out of a jump, on the heavy man (155 kg). Heights are those of the
simulated motion, with the reference's in the last row: the lower foot's sole at the top of the
jump, and the ankle at the top of the kick. With 300 Nm at every joint he jumps as the performer
does, which nobody would expect of him; with 100 Nm he jumps lower and lands bent over; with 50 Nm
he sinks to the floor. That is what the paper found.
"""
HORIZON = """## Time horizon

{clip} on the heavy man (155 kg). Of each kick: the height of the ankle at its top. Down: when the
pelvis first came below half its standing height. The paper's character fell with 0.8 and 0.9 s and
stood with 1.0 s, with limits of 100 Nm and its sampling optimiser, which keeps 0.4 s of each
window; this optimiser keeps 0.3 s, or 0.15 s where the body cannot follow.
"""
#: Of the clip that the paper's figure resembles.
HORIZON_FOUND = """
With the limits of his own strength he stands with each of the three, so there is nothing for a
longer horizon to repair. 100 Nm are too weak for 155 kg: with 0.8 s he goes down on a knee after
the first kick, gets up and kicks again; with 0.9 and 1.0 s he goes down before it and is lost.
There the horizon changes what he does, but not in the paper's order: who looks further ahead gives
in sooner.
"""
OBJECTS = """## Held objects

The average man (75 kg) with an object in the right hand; the performer holds nothing. First he
stands in the T-pose, then he walks (the embedded `walk`, 0 to 2 s). Means over the last two thirds.
Lean: of the line from pelvis to neck, away from the object (to the left). Centre of mass: of the
body without the object, to the left of the middle between the ankles. Arm: its angle above the
horizontal, and against the trunk (90 is square to it). Wrist: its distance from where the
performer's motion without an object has it. Torques: mean size over the axes of the right shoulder
and of the lowest spine joint.

With the limits of his own strength he holds up what he is given: E has no term for effort, so the
arm stays square to the trunk. He leans away, since the reference does (see
[bodies](bodies.md#held-objects)), and shoulder and trunk work more with every kilogram. In the walk
0.5 kg hardly shows. With 50 Nm at every joint he cannot hold 5 kg out: the
arm sinks, and pulls the trunk to its side.
"""
PARTS = ("torque", "horizon", "objects")
PAGE = """# The experiments of the paper's section 5

Made by `python benchmarks/section5.py --write docs/section5.md`.

"""


def main() -> None:
    """Run what was asked for and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=PARTS)
    parser.add_argument("--write", type=Path, help="a page (.md); its pictures go to images/")
    options = parser.parse_args()
    if options.write:
        (options.write.parent / "images").mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        if options.only in (None, part):
            text, picture = {"torque": torque, "horizon": horizon, "objects": objects}[part]()
            print(text)
            if options.write:
                write_png(options.write.parent / "images" / f"section5_{part}.png", picture)
                _store(options.write, part, text)


def torque() -> tuple[str, Array]:
    """Jump and kick of a heavy body, by torque limit."""
    limits: tuple[Any, ...] = (300.0, 100.0, 50.0)
    lines = [
        "| limit | followed | error, mean mm | jump mm | kick mm | torques at their limit |",
        "| --- " * 6 + "|",
    ]
    rows = []
    for limit in limits:
        run = _retarget("spinkick", "heavy", torque_limit=limit)
        m, q = run.metrics, run.trajectory.q
        lines.append(
            f"| {limit:g} Nm | {_yes(m['success'])} | {m['mpjpe_mm']:.0f} | {_jump(run, q):.0f} "
            f"| {_kick(run, q):.0f} | {m['torque_saturation']:.0%} |"
        )
        rows.append((f"{limit:g} Nm", run, q))
    reference = run.trajectory.reference_q
    lines.append(f"| reference | | | {_jump(run, reference):.0f} | {_kick(run, reference):.0f} | |")
    return TORQUE + "\n" + "\n".join(lines) + "\n", _sheet(rows)


def horizon() -> tuple[str, Array]:
    """Two kicks of a heavy body, by horizon and torque limit."""
    clip, reading = (KICKS, {"start": 2, "end": 6}) if KICKS.is_file() else ("kick", {})
    if not reading:
        print(f"no {KICKS.name} in ../shared/mocap: the embedded kick instead", file=sys.stderr)
    name = "Two front kicks (CMU 135_04, 2 to 6 s)" if reading else "The embedded `kick`"
    lines = [
        "| limits | horizon | followed | error, mean mm | worst frame | kicks mm | down | thousand steps/s |",
        "| --- " * 8 + "|",
    ]
    rows = []
    limits: tuple[Any, ...] = ("body", 100.0)
    for limit in limits:
        for seconds in (0.8, 0.9, 1.0):
            run = _retarget(clip, "heavy", torque_limit=limit, horizon=seconds, **reading)
            m, q = run.metrics, run.trajectory.q
            kicks = ", ".join(f"{k:.0f}" for k in _kicks(run, q))
            label = _limit(limit)
            lines.append(
                f"| {label} | {seconds:g} s | {_yes(m['success'])} | {m['mpjpe_mm']:.0f} "
                f"| {m['mpjpe_max_mm']:.0f} | {kicks} | {_fell(run)} "
                f"| {m['sim_steps_per_motion_s'] / 1e3:.0f} |"
            )
            rows.append((f"{label}, {seconds:g} s", run, q))
    kicks = ", ".join(f"{k:.0f}" for k in _kicks(run, run.trajectory.reference_q))
    lines.append(f"| | reference | | | | {kicks} | | |")
    text = HORIZON.format(clip=name) + (HORIZON_FOUND if reading else "")
    return text + "\n" + "\n".join(lines) + "\n", _sheet(rows)


def objects() -> tuple[str, Array]:
    """What a stick of growing mass, and a block, do to standing and walking."""
    texts = (None, "stick:0.5kg", "stick:2kg", "stick:5kg", "stick:10kg", "block:5kg")
    own = [(text, "body") for text in texts]
    weak = [(text, 50.0) for text in (None, "stick:5kg", "stick:10kg")]
    lines = [
        "| motion | object | limits | followed | lean deg | centre of mass mm | arm deg "
        "| arm to trunk deg | wrist mm | shoulder Nm | trunk Nm | E |",
        "| --- " * 12 + "|",
    ]
    stand, rows = [], []
    clips: list[tuple[str, Any, dict[str, Any], list[tuple[Any, Any]]]] = [
        ("stand", standing(2.0), {}, own + weak),
        ("walk", "walk", {"end": 2.0}, own),
    ]
    for name, clip, reading, cases in clips:
        wanted = None
        for text, limit in cases:
            run = _retarget(clip, "average", hold=_held(text), torque_limit=limit, **reading)
            if wanted is None:
                wanted = kinematics.joint_positions(run.character(), run.trajectory.reference_q)
            f = posture(run, wanted)
            lines.append(
                f"| {name} | {text or 'nothing'} | {_limit(limit)} | {_yes(run.success)} "
                f"| {f['lean']:.1f} | {f['com']:.0f} | {f['arm']:.1f} | {f['arm_to_trunk']:.1f} "
                f"| {f['wrist']:.0f} | {f['shoulder']:.1f} | {f['trunk']:.1f} "
                f"| {run.metrics['cost']['total']:.2f} |"
            )
            label = (text or "nothing") + ("" if limit == "body" else f", {_limit(limit)}")
            (stand if name == "stand" else rows).append((label, run, run.trajectory.q))
    return OBJECTS + "\n" + "\n".join(lines) + "\n", _front(stand, rows)


def standing(seconds: float) -> Motion:
    """The average body at rest in the T-pose."""
    rest = physique.capsule_body(physique.named_body("average")).joints
    frames = round(100 * seconds) + 1
    turns = np.tile(rotations.IDENTITY, (frames, len(skeleton.JOINTS), 1))
    root, contacts = np.tile(rest[0], (frames, 1)), np.ones((frames, 2), dtype=bool)
    return Motion("stand", "T-pose", 100.0, turns, root, rest, contacts)


def posture(run: physique.Run, wanted: Array) -> dict[str, float]:
    """What the last two thirds of a run look like on average; wanted (T, 22, 3) m: the performer's
    joints. Degrees, mm and Nm."""
    part = slice(run.trajectory.frames // 3, None)
    pose = kinematics.poses(empty_handed(run.character()), run.trajectory.q[part])
    joints, torque = pose.joints, run.trajectory.torque[part]
    spine = joints[:, JOINT["neck"]] - joints[:, 0]
    arm = joints[:, JOINT["right_wrist"]] - joints[:, JOINT["right_shoulder"]]
    arm /= np.linalg.norm(arm, axis=1, keepdims=True)
    down = -spine / np.linalg.norm(spine, axis=1, keepdims=True)
    feet = joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]]].mean(axis=1)
    off = joints[:, JOINT["right_wrist"]] - wanted[part][: len(joints), JOINT["right_wrist"]]

    def effort(joint: str) -> float:
        return float(np.abs(torque[:, columns(joint)]).mean())

    return {
        "lean": float(np.degrees(np.arctan2(spine[:, 1], spine[:, 2])).mean()),
        "com": 1e3 * float((pose.com - feet)[:, 1].mean()),
        "arm": float(np.degrees(np.arcsin(arm[:, 2])).mean()),
        "arm_to_trunk": float(np.degrees(np.arccos(np.sum(arm * down, axis=1))).mean()),
        "wrist": 1e3 * float(np.linalg.norm(off, axis=1).mean()),
        "shoulder": effort("right_shoulder"),
        "trunk": effort("spine1"),
    }


def _held(text: str | None) -> physique.Held | None:
    return None if text is None else physique.parse_held(text)


def _retarget(clip: Any, body: str, **options: Any) -> physique.Run:
    print(f"{getattr(clip, 'name', clip)} on {body} {options}", file=sys.stderr, flush=True)
    return physique.retarget(clip, body, threads=1, **options)


def _jump(run: physique.Run, q: Array) -> float:
    """Greatest height, mm, of the lowest point of both feet."""
    points = sole_points(run.character(), q)[..., 2]
    return 1e3 * max(0.0, float(points.min(axis=(1, 2)).max()))


def _kick(run: physique.Run, q: Array) -> float:
    """Greatest height, mm, of an ankle."""
    return 1e3 * float(_ankles(run, q).max())


def _kicks(run: physique.Run, q: Array) -> list[float]:
    """Greatest height, mm, of an ankle in each half of the motion."""
    heights = 1e3 * _ankles(run, q).max(axis=1)
    return [float(half.max()) for half in np.array_split(heights, 2)]


def _ankles(run: physique.Run, q: Array) -> Array:
    joints = kinematics.joint_positions(run.character(), q)
    return joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]], 2]


def _fell(run: physique.Run) -> str:
    """When the pelvis came down to half its height."""
    low = run.trajectory.q[:, 2] < FALLEN * run.body.joints[0, 2]
    return f"at {run.trajectory.times[np.argmax(low)]:.2f} s" if low.any() else "no"


def _limit(limit: Any) -> str:
    return "body" if limit == "body" else f"{limit:g} Nm"


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _sheet(rows: Sequence[tuple[str, physique.Run, Array]], n: int = 9) -> Array:
    """A strip of n frames for each run, with its name."""
    return strip([_scene(*row) for row in rows], n)


def _front(
    stand: Sequence[tuple[str, physique.Run, Array]], walk: Sequence[tuple[str, physique.Run, Array]]
) -> Array:
    """From the front, all at one scale: the last pose of who stands, strips of who walks."""
    shown = [row for row in walk if row[0] in ("nothing", "stick:2kg", "stick:10kg", "block:5kg")]
    scenes = at_one_scale(
        [_scene(label, run, q[-1:], azimuth=0.0) for label, run, q in stand]
        + [_scene(*row, azimuth=0.0) for row in shown]
    )
    poses = np.concatenate([scene.picture(0) for scene in scenes[: len(stand)]], axis=1)
    walks = strip(scenes[len(stand) :], len(stand))
    sheet = np.full((PANEL[1] + 2 + len(walks), walks.shape[1], 3), 255, dtype=np.uint8)
    sheet[: PANEL[1], : poses.shape[1]], sheet[PANEL[1] + 2 :] = poses, walks
    return sheet


def _scene(label: str, run: physique.Run, q: Array, azimuth: float = AZIMUTH) -> Scene:
    return stage([make_actor(surface(run), q, label=label)], 1 / run.timestep, PANEL, azimuth=azimuth)


def _store(page: Path, part: str, text: str) -> None:
    """Put a part into the page, in the place of the one that was there."""
    old = page.read_text(encoding="utf-8") if page.is_file() else ""
    kept = {}
    for name, title in (("torque", TORQUE), ("horizon", HORIZON), ("objects", OBJECTS)):
        head = title.splitlines()[0]
        if head in old:
            kept[name] = head + old.split(head, 1)[1].split("\n## ", 1)[0].rstrip() + "\n"
    kept[part] = f"{text}\n![{part}](images/section5_{part}.png)\n"
    body = "\n".join(kept[name] for name in PARTS if name in kept)
    write_atomic(page, (PAGE + body).encode())


if __name__ == "__main__":
    main()

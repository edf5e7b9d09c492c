"""Section 5, held objects: what a stick of growing mass, and a block, do to standing and walking.

    python -m physique.experiments.objects --write docs/section5.md

Takes some minutes; what is finished is kept in out/section5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from physique import skeleton
from physique.body.held import parse_held
from physique.character import kinematics
from physique.character.hinges import columns
from physique.character.model import empty_handed
from physique.experiments.section5 import (
    Array,
    Picture,
    Row,
    Section5,
    limits_in_words,
    markdown,
    present,
    scene,
    yes,
)
from physique.experiments.standing import standing
from physique.render.picture import strip
from physique.render.scene import at_one_scale
from physique.runs.run import Run

SECONDS = 2.0
GAP = 2  # pixels
OBJECTS = (None, "stick:0.5kg", "stick:2kg", "stick:5kg", "stick:10kg", "block:5kg")
OWN: tuple[tuple[str | None, Any], ...] = tuple((held, "body") for held in OBJECTS)
WEAK: tuple[tuple[str | None, Any], ...] = ((None, 50.0), ("stick:5kg", 50.0), ("stick:10kg", 50.0))
#: Whose walk is shown.
SHOWN = ("nothing", "stick:2kg", "stick:10kg", "block:5kg")
TEXT = """## Held objects

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
HEAD = (
    "motion | object | limits | followed | lean deg | centre of mass mm | arm deg | arm to trunk deg "
    "| wrist mm | shoulder Nm | trunk Nm | E"
)


def measure(options: Section5) -> tuple[str, Picture]:
    """Text and picture."""
    seconds = options.end or SECONDS
    table = [HEAD.split(" | ")]
    shown: dict[str, list[Row]] = {"stand": [], "walk": []}
    clips: tuple[tuple[str, Any, dict[str, Any], Any], ...] = (
        ("stand", standing("average", seconds, arms=0.0), {}, OWN + WEAK),
        ("walk", "walk", {"end": seconds}, OWN),
    )
    for motion, clip, reading, cases in clips:
        wanted = None
        for text, limit in cases:
            held = None if text is None else parse_held(text)
            name = f"{motion}_{text or 'nothing'}_{limit}".replace(":", "_")
            run = options.run(clip, "average", name, hold=held, torque_limit=limit, **reading)
            if wanted is None:
                wanted = kinematics.joint_positions(run.character(), run.trajectory.reference_q)
            table.append([motion, text or "nothing", limits_in_words(limit), yes(run.success)])
            table[-1] += posture(run, wanted)
            label = (text or "nothing") + ("" if limit == "body" else f", {limits_in_words(limit)}")
            shown[motion].append((label, run, run.trajectory.q))
    return TEXT + markdown(table), front(shown["stand"], shown["walk"])


def posture(run: Run, wanted: Array) -> list[str]:
    """What the last two thirds of a run look like on average, in the order of `HEAD` from the lean
    on; wanted (T, 22, 3) m: the performer's joints."""
    part, at = slice(run.trajectory.frames // 3, None), skeleton.INDEX
    pose = kinematics.poses(empty_handed(run.character()), run.trajectory.q[part])
    joints, torque = pose.joints, run.trajectory.torque[part]
    spine = joints[:, at["neck"]] - joints[:, 0]
    arm = joints[:, at["right_wrist"]] - joints[:, at["right_shoulder"]]
    arm /= np.linalg.norm(arm, axis=1, keepdims=True)
    down = -spine / np.linalg.norm(spine, axis=1, keepdims=True)
    feet = joints[:, [at["left_ankle"], at["right_ankle"]]].mean(axis=1)
    off = joints[:, at["right_wrist"]] - wanted[part][: len(joints), at["right_wrist"]]
    effort = (np.abs(torque[:, columns(joint)]).mean() for joint in ("right_shoulder", "spine1"))
    return [
        f"{np.degrees(np.arctan2(spine[:, 1], spine[:, 2])).mean():.1f}",
        f"{1e3 * (pose.com - feet)[:, 1].mean():.0f}",
        f"{np.degrees(np.arcsin(arm[:, 2])).mean():.1f}",
        f"{np.degrees(np.arccos(np.sum(arm * down, axis=1))).mean():.1f}",
        f"{1e3 * np.linalg.norm(off, axis=1).mean():.0f}",
        *(f"{mean:.1f}" for mean in effort),
        f"{run.metrics['cost']['total']:.2f}",
    ]


def front(stand: Sequence[Row], walk: Sequence[Row]) -> Picture:
    """From the front, all at one scale: the last pose of who stands, strips of who walks."""
    scenes = at_one_scale(
        [scene(label, run, q[-1:], azimuth=0.0) for label, run, q in stand]
        + [scene(*row, azimuth=0.0) for row in walk if row[0] in SHOWN]
    )
    poses = np.concatenate([one.picture(0) for one in scenes[: len(stand)]], axis=1)
    walks = strip(scenes[len(stand) :], len(stand))
    height, width = len(poses) + GAP, max(poses.shape[1], walks.shape[1])
    picture = np.full((height + len(walks), width, 3), 255, dtype=np.uint8)
    picture[: len(poses), : poses.shape[1]], picture[height:, : walks.shape[1]] = poses, walks
    return picture


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and store."""
    present("objects", measure, arguments)


if __name__ == "__main__":
    main()

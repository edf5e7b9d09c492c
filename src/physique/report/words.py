"""What the metrics of a run mean, in words for people who do not know their names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from physique.render.layout import strength
from physique.runs.run import Run


@dataclass(frozen=True)
class Row:
    """One line of the table: what is measured, what that means, and what it is for this run."""

    label: str
    meaning: str
    value: str


#: What turning about an axis of the T-pose is called, for arms, which point along y, and the rest.
_ARM = {"x": "up and down", "y": "twist", "z": "forward and back"}
_OTHER = {"x": "sideways", "y": "bending", "z": "twist"}


def joint_words(joint: str) -> str:
    """A joint of `skeleton.JOINTS` as people say it: "left_foot" is "left toes"."""
    for name, words in (
        ("spine1", "lower back"),
        ("spine2", "middle back"),
        ("spine3", "upper back"),
        ("foot", "toes"),
        ("collar", "shoulder blade"),
    ):
        joint = joint.replace(name, words)
    return joint.replace("_", " ")


def hinge_words(hinge: str) -> str:
    """One angle of a joint as people say it: "right_ankle_x" is "right ankle (sideways)"."""
    joint, _, axis = hinge.rpartition("_")
    arm = any(part in joint for part in ("collar", "shoulder", "elbow", "wrist"))
    return f"{joint_words(joint)} ({(_ARM if arm else _OTHER)[axis]})"


def verdict(run: Run) -> str:
    """The outcome in one sentence."""
    metrics = run.metrics
    lost = lost_at(metrics)
    if lost is not None:
        return f"Lost the motion after {lost:.2f} s of {metrics['reference_seconds']:.2f} s."
    return (
        f"Performed all {metrics['seconds']:.2f} s, on average "
        f"{length(metrics['mpjpe_mm'])} off the recording."
    )


def lost_at(metrics: Mapping[str, Any]) -> float | None:
    """Start, s, of the first window that went wrong, the end where none did; None on success."""
    if metrics["success"]:
        return None
    bad = [window["start"] for window in metrics["windows"] if not window["success"]]
    return float(bad[0] if bad else metrics["seconds"])


def rows(run: Run) -> list[Row]:
    """The metrics of a run that tell how it went, each with what it means."""
    m = run.metrics
    lost = lost_at(m)
    worst = m["worst_frame"]
    seconds = m["seconds"]
    return [
        Row(
            "To the end",
            "It counts as lost where the joints are half a metre off on average.",
            "yes" if lost is None else f"no, lost at {lost:.2f} s",
        ),
        Row(
            "Off from the recording",
            "How far the joints are from where the recording, fitted to this body, has them.",
            f"{length(m['mpjpe_mm'])} on average, {length(m['mpjpe_max_mm'])} at the worst moment",
        ),
        Row(
            "Off in pose alone",
            "The same with both hips put in one place: the pose without the way through the room.",
            length(m["mpjpe_local_mm"]),
        ),
        Row(
            "Furthest off",
            "The joint that misses its place most, in the worst moment.",
            f"{joint_words(worst['joint'])}, {length(worst['joint_error_mm'])} at {worst['time']:.2f} s",
        ),
        Row(
            "Feet slide",
            "How fast what touches the floor moves over it.",
            f"{m['foot_skate_mm_per_s']:.0f} mm a second while on the floor",
        ),
        Row(
            "Standing feet slide",
            "The same, only while the recording has the foot standing.",
            f"{m['foot_skate_planted_mm_per_s']:.0f} mm a second; "
            f"in the recording {m['foot_skate_source_mm_per_s']:.0f}",
        ),
        Row(
            "Sinks into the floor",
            "Contact is slightly soft, so it is not quite zero.",
            f"{m['penetration_mm']:.1f} mm on average, {m['penetration_max_mm']:.0f} mm at most",
        ),
        Row("At full strength", "How often a joint gives all the torque it has.", _strength(m)),
        Row("Largest torque", "Of any joint at any moment.", f"{m['torque_peak_nm']:.0f} Nm"),
        Row(
            "Recording moved",
            "How far the recording was shifted over the floor so that the body could catch up.",
            f"{length(m['drift_mm'])} at most",
        ),
        Row(
            "Cost",
            "What the computation makes as small as it can (E of the paper); lower is closer.",
            f"{m['cost']['total'] / seconds:.1f} a second" if seconds else "none",
        ),
        Row("Price", "Simulated steps to find the motion, for each second of it.", _price(m)),
    ]


def settings(run: Run) -> list[tuple[str, str]]:
    """What the run was made with."""
    record, identity = run.record, run.record["identity"]
    begin, end = identity.get("start"), identity.get("end")
    named: list[tuple[str, Any]] = [
        # The file's name only: a report is mailed to people who need not know the folder.
        ("clip", re.split(r"[/\\\\]", str(record.get("clip_source", identity["clip"])))[-1]),
        ("part", f"{begin or 0:g} s to " + ("the end" if end is None else f"{end:g} s")),
        ("frame rate", "as in the file" if identity.get("fps") is None else f"{identity['fps']:g}"),
        ("body", f"{run.body.name}, {run.body.height:.2f} m, {run.body.mass:.1f} kg"),
        ("torque limits", strength(run)),
        ("in the hands", run.holding or None),
        ("optimiser", identity.get("optimizer")),
        ("look-ahead", _seconds(identity.get("horizon"))),
        ("kept of each window", _seconds(identity.get("commit"))),
        ("seed", identity.get("seed")),
        *identity.get("versions", {}).items(),
    ]
    return [(name, str(value)) for name, value in named if value is not None]


def length(mm: float) -> str:
    """A distance in mm, cm or m, whichever suits its size."""
    if mm < 100:
        return f"{mm:.0f} mm"
    return f"{mm / 10:.0f} cm" if mm < 1000 else f"{mm / 1000:.1f} m"


def _seconds(value: float | None) -> str | None:
    return None if value is None else f"{value:g} s"


def _strength(m: Mapping[str, Any]) -> str:
    by_joint = m["torque_saturation_by_joint"]
    if not by_joint:
        return "never"
    name = max(by_joint, key=lambda key: by_joint[key])
    return (
        f"{100 * m['torque_saturation']:.1f} % of the time over all joints; "
        f"most of all {hinge_words(name)} {100 * by_joint[name]:.0f} %"
    )


def _price(m: Mapping[str, Any]) -> str:
    steps = m.get("sim_steps_per_motion_s")
    return "unknown" if steps is None else f"{steps:,.0f} steps"

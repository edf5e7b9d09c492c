"""Why a part of a clip is hard: each cause is named where it acts, and only there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from physique.character.hinges import HINGES
from physique.report.difficulty import parts
from physique.report.words import hinge_words, joint_words
from physique.runs.run import Run

CALM = np.zeros((50, 50))
NEAR = np.zeros((51, 22))
STANDING = np.ones((2, 51, 2), dtype=bool)


def window(run: Run, **changes: object) -> Run:
    """The run with both of its windows changed."""
    windows = [{**w, **changes} for w in run.metrics["windows"]]
    return dataclasses.replace(run, metrics={**run.metrics, "windows": windows})


def causes(run: Run, use=CALM, error=NEAR, floor=STANDING) -> list[dict[str, str]]:  # type: ignore[no-untyped-def]
    return [dict(part.causes) for part in parts(run, use, error, floor)]


@pytest.mark.parametrize(
    ("difficulty", "level"),
    [(0.0, "easy"), (2.9, "easy"), (3.1, "fair"), (12.0, "hard"), (25.0, "very hard")],
)
def test_levels(run: Run, difficulty: float, level: str) -> None:
    for part in parts(window(run, difficulty=difficulty), CALM, NEAR, STANDING):
        assert part.level == level
        assert sum(part.shares.values()) == pytest.approx(1.0)
        assert (part.causes == ()) == (level == "easy")


def test_a_window_that_fails_is_lost_however_small_its_cost(run: Run) -> None:
    found = parts(window(run, difficulty=0.1, success=False), CALM, NEAR, STANDING)
    assert [part.level for part in found] == ["lost", "lost"]


@pytest.mark.parametrize(
    ("term", "word"),
    [
        ("com", "balance"),
        ("com_velocity", "balance"),
        ("pose", "pose"),
        ("root", "trunk"),
        ("velocity", "speed"),
        ("acceleration", "speed"),
    ],
)
def test_the_leading_term_is_named(run: Run, term: str, word: str) -> None:
    run = window(run, difficulty=20.0, cost_terms={term: 5.0, "pose": 0.1})
    assert [list(c) for c in causes(run)] == [[word], [word]]


def test_joints_at_their_limit_are_named_where_they_are(run: Run) -> None:
    use = CALM.copy()
    knee = [h.name for h in HINGES].index("left_knee_y")
    use[35:45, knee] = 1.0  # half of the second window
    first, second = causes(window(run, difficulty=20.0), use=use)
    assert "strength" not in first
    assert "left knee (bending) 50 % of the time" in second["strength"]
    assert next(iter(second)) == "strength"


def test_feet_out_of_step_with_the_recording_are_named(run: Run) -> None:
    floor = STANDING.copy()
    floor[1, :15, 0] = False  # the recording lifts the left foot, the body does not
    floor[0, 30:50, 1] = False  # the body lifts the right foot
    first, second = causes(window(run, difficulty=20.0), floor=floor)
    assert first["contact"] == (
        "left foot on the floor where the recording has it in the air, 50 % of the time"
    )
    assert second["contact"] == (
        "right foot in the air where the recording has it on the floor, 100 % of the time"
    )


def test_pose_names_the_joints_that_are_furthest_off(run: Run) -> None:
    error = NEAR.copy()
    error[:, 18], error[:, 20] = 1210.0, 80.0
    run = window(run, difficulty=20.0, cost_terms={"pose": 1.0})
    for found in causes(run, error=error):
        assert found["pose"].endswith("furthest off: left elbow 1.2 m, left wrist 80 mm")


def test_every_joint_and_angle_has_words() -> None:
    words = [hinge_words(hinge.name) for hinge in HINGES]
    assert len(set(words)) == len(words)
    assert not [w for w in words if "_" in w]
    assert hinge_words("right_ankle_x") == "right ankle (sideways)"
    assert hinge_words("left_shoulder_z") == "left shoulder (forward and back)"
    assert joint_words("spine2") == "middle back"
    assert joint_words("left_foot") == "left toes"

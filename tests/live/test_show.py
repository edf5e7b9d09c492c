"""Runs that are played and performed live: what is shown, who is pushed, what is counted."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from physique import skeleton
from physique.live.controllers import Replay, controllers_of
from physique.live.curves import difficulty
from physique.live.performance import LEAST_LEFT, Score
from physique.live.show import LINGER, Act, Show
from physique.render.skin import joint_transforms
from physique.runs.run import Run
from physique.simulation.session import Hit
from standing import Balance
from stepped_runs import BORDER, stepped

Array = NDArray[np.float64]
CHEST = Hit(skeleton.INDEX["spine3"], np.zeros(3))
BACK = np.array([-1.0, 0.0, 0.0])
#: The regulator stands this, the replay does not (in Ns).
TELLING = 14.0


def make(run: Run, balance: Balance | None = None) -> Show:
    controllers = {"replay": Replay(run.trajectory)}
    return Show([run], [controllers if balance is None else {**controllers, "balance": balance}])


def live(show: Show) -> Act:
    show.restarts = False
    show.go_live(True)
    return show.acts[0]


def play(show: Show, seconds: float) -> None:
    for _ in range(round(seconds / show.timestep)):
        show.advance(show.timestep)


def test_the_replay_is_the_recording_to_the_bit(standing: Run) -> None:
    show = make(standing)
    act = live(show)
    for t in range(1, standing.trajectory.frames):
        show.advance(show.timestep)
        assert act.trial.frame == t
        assert np.array_equal(act.trial.session.q, standing.trajectory.q[t])
    assert act.trial.finished
    assert not act.trial.fallen
    # So are the curves, those that were computed step by step and those of the recording.
    for name in ("error", "torque", "floor", "pressure"):
        seen, stored = getattr(act.trial.curves, name), getattr(act.recorded, name)
        assert np.allclose(seen[:-1], stored[:-1], atol=1e-6, equal_nan=True), name


def test_the_recording_is_shown_frame_by_frame(standing: Run) -> None:
    show = make(standing)
    act = show.acts[0]
    show.seek(0.5)
    expected = joint_transforms(standing.body, standing.trajectory.q[50][None])[0]
    assert np.allclose(show.poses(act)[:, :3], expected[..., 3])
    show.seek(1e9)
    assert show.frame_of(act) == standing.trajectory.frames - 1
    # Live, from the same moment, nothing jumps.
    show.seek(0.5)
    before = show.poses(act)
    show.go_live(True)
    assert np.allclose(before[:, :3], show.poses(act)[:, :3], atol=1e-5)
    assert show.frame_of(act) == 50


def test_a_push_tells_controllers_apart(standing: Run, balance: Balance) -> None:
    show = make(standing, balance)
    assert show.chosen == ["balance"]
    act = live(show)
    show.push(0, CHEST, TELLING * BACK, False)
    assert act.trial.score == Score(pushes=1, open=1)
    play(show, 2.3)
    assert act.trial.score == Score(pushes=1, survived=1)
    show.choose(0, "replay")
    assert act.trial.score == Score()
    show.push(0, CHEST, TELLING * BACK, False)
    play(show, 2.3)
    assert act.trial.fallen
    assert act.trial.score == Score(pushes=1, failed=1)
    assert show.score_rows() == [(0, "balance", Score(1, 1, 0)), (0, "replay", Score(1, 0, 1))]
    show.forget()
    assert show.score_rows() == [(0, "replay", Score())]


def test_pushes_that_cannot_be_judged_are_not(standing: Run) -> None:
    show = make(standing)
    act = live(show)
    show.seek(show.timeline.duration - LEAST_LEFT + 0.1)
    show.push(0, CHEST, 5.0 * BACK, False)
    assert act.trial.score == Score(pushes=1)
    show.seek(0.0)
    show.push(0, CHEST, 5.0 * BACK, False)
    play(show, 0.2)
    # A restart cuts it short.
    show.seek(0.0)
    assert act.trial.score == Score(pushes=2)
    assert act.trial.score.not_judged == 2


def test_a_fall_fails_all_open_pushes(standing: Run) -> None:
    show = make(standing)
    act = live(show)
    for _ in range(3):
        show.push(0, CHEST, 30.0 * BACK, False)
        play(show, 0.05)
    play(show, 1.2)
    assert act.trial.fallen
    assert act.trial.score == Score(pushes=3, failed=3)


def test_a_push_on_all_alike(standing: Run) -> None:
    controllers = [{"replay": Replay(standing.trajectory)} for _ in range(2)]
    show = Show([standing, standing], controllers)
    live(show)
    assert show.push(1, CHEST, 5.0 * BACK, True) == [0, 1]
    play(show, 0.5)
    assert np.array_equal(*(act.trial.session.q for act in show.acts))
    assert show.push(1, CHEST, 5.0 * BACK, False) == [1]
    play(show, 0.5)
    assert not np.array_equal(*(act.trial.session.q for act in show.acts))


def test_a_push_wakes_a_recording_that_is_paused(standing: Run) -> None:
    show = make(standing)
    show.timeline.playing = False
    show.seek(0.4)
    chest = show.poses(show.acts[0])[CHEST.part, :3]
    hit = show.hit(0, chest - 3.0 * BACK, BACK)
    assert hit is not None
    show.push(0, hit, 5.0 * BACK, False)
    assert show.live
    assert show.timeline.playing
    play(show, 0.1)
    assert show.acts[0].trial.frame == 50


def test_a_push_at_the_end_begins_anew(standing: Run) -> None:
    show = make(standing)
    act = live(show)
    play(show, show.timeline.duration + 0.2)
    assert act.trial.finished
    show.push(0, CHEST, 5.0 * BACK, False)
    assert act.trial.frame == 0
    assert act.trial.score == Score(pushes=1, open=1)


def test_when_all_is_over_it_begins_anew(standing: Run) -> None:
    show = make(standing)
    show.go_live(True)
    play(show, show.timeline.duration + 0.5 * LINGER)
    trial = show.acts[0].trial
    assert trial.finished
    assert np.array_equal(trial.session.q, standing.trajectory.q[-1])
    play(show, LINGER)
    assert show.timeline.time < LINGER
    assert not trial.over


def test_speed_and_slow_machines(standing: Run) -> None:
    show = make(standing)
    act = live(show)
    show.timeline.speed = 0.25
    for _ in range(10):
        show.advance(0.02)
    assert act.trial.session.steps == 5
    # A page that stood still does not rush.
    show.timeline.speed = 1.0
    show.advance(60.0)
    assert act.trial.session.steps <= 30


def test_difficulty_is_that_of_each_frames_window(standing: Run) -> None:
    curve = difficulty(standing)
    border = round(standing.metrics["windows"][0]["end"] / 0.01)
    assert set(curve[: border + 1]) == {1.5}
    assert set(curve[border + 1 :]) == {4.0}


def test_a_run_without_a_policy_is_replayed(standing: Run) -> None:
    assert list(controllers_of(standing)) == ["replay"]


@pytest.mark.parametrize("frame", [0, 7, 10**6])
def test_the_replay_holds_its_last_targets(standing: Run, frame: int) -> None:
    control = standing.trajectory.control
    replay = Replay(standing.trajectory)
    replay.reset(frame)
    at = min(frame, len(control))
    assert replay.frame == at
    given = [replay.act(np.zeros(57), np.zeros(56)) for _ in range(3)]
    for i, targets in enumerate(given):
        assert np.array_equal(targets, control[min(at + i, len(control) - 1)])
    assert replay.frame == min(at + 3, len(control))


def test_the_ghost_stays_and_errors_are_against_the_moved_source(run: Run) -> None:
    still, moved = (make(r).acts[0] for r in (run, stepped(run)))
    assert moved.source == pytest.approx(still.source)
    assert moved.recorded.error[: BORDER + 1] == pytest.approx(still.recorded.error[: BORDER + 1])
    assert abs(moved.recorded.error[BORDER + 1] - still.recorded.error[BORDER + 1]) > 1e-2
    # The live performance measures as the recording does.
    moved.trial.restart(BORDER + 5)
    assert moved.trial.error == pytest.approx(moved.recorded.error[BORDER + 5], abs=1e-6)

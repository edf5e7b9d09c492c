"""Scenes: everybody is in the picture, in order, apart, and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physique.errors import InputError
from physique.render.scene import at_one_scale, make_actor, stage, stage_runs
from physique.render.surface import capsule_surface
from physique.runs.run import Run

SIZE = (200, 150)


def shorter(run: Run, frames: int) -> Run:
    return replace(run, trajectory=run.trajectory.beginning(frames))


def test_figures_stand_side_by_side_in_the_picture(run: Run) -> None:
    scene = stage_runs([run, run, run], SIZE, source=True, capsules=True)
    assert [actor.ghost for actor in scene.actors] == [True, False] * 3
    right = scene.camera.axes()[0]
    for frame in (0, 20, 40):
        camera = scene.camera.follow(scene.route[frame])
        spans = []
        for actor in scene.actors:
            v = actor.vertices(frame)
            pixels = camera.project(v, SIZE)
            assert pixels.min() > 0
            assert (pixels.max(axis=0) < SIZE).all()
            spans.append((v @ right).min())
            spans.append((v @ right).max())
        assert spans == sorted(spans)  # from left to right, nobody over another


def test_each_is_drawn_where_it_stands(run: Run) -> None:
    shapes = capsule_surface(run.body)
    colours = ("#e63333", "#3333e6")
    scene = stage([make_actor(shapes, run.trajectory.q, colour=rgb) for rgb in colours], 100.0, SIZE)
    image = scene.picture(20).astype(int)
    camera = scene.camera.follow(scene.route[20])
    for actor, channel in zip(scene.actors, (0, 2)):
        chest = actor.joints(scene.frames)[20, 6]
        column, row = camera.project(chest, SIZE).astype(int)
        assert image[row, column].argmax() == channel


def test_the_last_pose_stays_until_all_have_ended(run: Run) -> None:
    scene = stage_runs([run, shorter(run, 11)], SIZE, capsules=True)
    assert scene.frames == run.trajectory.frames
    short = scene.actors[1]
    assert np.array_equal(short.vertices(10), short.vertices(50))
    assert not np.array_equal(short.vertices(9), short.vertices(10))


def test_captions_can_be_left_out(run: Run) -> None:
    scene = stage_runs([run], SIZE, capsules=True)
    plain, captioned = scene.picture(3, caption=False), scene.picture(3)
    changed = np.flatnonzero((plain != captioned).any(axis=(1, 2)))
    assert changed.min() < 30  # the name
    assert changed.max() > 130  # the time
    assert np.array_equal(plain[60:120], captioned[60:120])


def test_the_camera_moves_smoothly(run: Run) -> None:
    q = np.repeat(run.trajectory.q[:1], 200, axis=0)
    q[100:, 0] += 1.0
    scene = stage([make_actor(capsule_surface(run.body), q)], 100.0, SIZE)
    assert np.ptp(scene.route[:, 0]) == pytest.approx(1.0, abs=1e-3)
    assert np.abs(np.diff(scene.route[:, 0])).max() < 0.02


def test_as_much_is_seen_to_the_left_as_to_the_right(run: Run) -> None:
    """A wide figure beside a narrow one does not push the picture aside."""
    shapes = capsule_surface(run.body)
    wide = replace(shapes, vertices=shapes.vertices * [2.0, 2.0, 1.0])
    q = run.trajectory.q
    scene = stage([make_actor(wide, q), make_actor(shapes, q)], 100.0, SIZE)
    right = scene.camera.axes()[0]
    seen = [(a.vertices(t) - [*scene.route[t], 0.0]) @ right for a in scene.actors for t in range(51)]
    assert min(x.min() for x in seen) == pytest.approx(-max(x.max() for x in seen), abs=0.02)


def test_scenes_at_one_scale_have_one_camera(run: Run) -> None:
    alone, pair = stage_runs([run], SIZE, capsules=True), stage_runs([run, run], SIZE, capsules=True)
    both = at_one_scale([alone, pair])
    assert both[0].camera == both[1].camera
    assert np.linalg.norm(both[0].camera.eye) >= np.linalg.norm(pair.camera.eye) - 1e-9
    assert at_one_scale([alone])[0].camera == alone.camera


def test_pictures_come_in_order_however_many_draw(run: Run) -> None:
    scene = stage_runs([run], (32, 24), capsules=True)
    frames = [*range(40, 0, -2), 0]
    for threads in (1, 3):
        found = list(scene.pictures(frames, threads))
        assert len(found) == len(frames)
        for picture, frame in list(zip(found, frames))[::5]:
            assert np.array_equal(picture, scene.picture(frame))


def test_the_ghost_is_the_source_where_it_was_recorded(run: Run) -> None:
    """The reference is moved at the borders of windows; the ghost does not jump there."""
    motion = run.trajectory
    jump = np.where(np.arange(motion.frames) < 30, 0.0, 0.5)[:, None] * [1.0, 0.0]
    moved = motion.reference_q.copy()
    moved[:, :2] += jump
    jumping = replace(run, trajectory=replace(motion, reference_q=moved, shift=motion.shift + jump))
    ghosts = [stage_runs([r], SIZE, source=True).actors[0].transforms for r in (run, jumping)]
    assert np.abs(ghosts[0] - ghosts[1]).max() < 1e-12


def test_scenes_that_cannot_be_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match="no actors"):
        stage([], 100.0)
    with pytest.raises(InputError, match="16 to 4096"):
        stage_runs([run], (8, 8))
    slow = replace(run.trajectory, times=run.trajectory.times * 2)
    with pytest.raises(InputError, match=r"time steps from 0\.01 to 0\.02 s"):
        stage_runs([run, replace(run, trajectory=slow)])

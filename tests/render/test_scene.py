"""Scenes: everybody is in the picture, in order, apart, and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physique.errors import InputError
from physique.render.scene import make_actor, stage, stage_runs
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


def test_scenes_that_cannot_be_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match="no actors"):
        stage([], 100.0)
    with pytest.raises(InputError, match="16 to 4096"):
        stage_runs([run], (8, 8))
    slow = replace(run.trajectory, times=run.trajectory.times * 2)
    with pytest.raises(InputError, match=r"time steps from 0\.01 to 0\.02 s"):
        stage_runs([run, replace(run, trajectory=slow)])

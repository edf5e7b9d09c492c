"""Sheets, animations and bodies: who, when, at which scale; and always the same bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as PillowImage

from physique.errors import InputError
from physique.render.picture import animation, body_picture, strip
from physique.render.scene import Scene, make_actor, stage, stage_runs
from physique.render.surface import capsule_surface, skin_surface
from physique.runs.run import Run

PANEL = (80, 110)
RED = "#e63333"


def red(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    colour = image.astype(int)
    return np.asarray(colour[..., 0] - colour[..., 2] > 50)


def red_scene(run: Run, size: tuple[int, int] = PANEL, frames: int = 51) -> Scene:
    shown = capsule_surface(run.body)
    return stage([make_actor(shown, run.trajectory.q[:frames], colour=RED)], 100.0, size)


def test_a_strip_is_frames_in_columns_and_scenes_in_rows(run: Run) -> None:
    rows = [stage_runs([run], PANEL, source=source, capsules=True) for source in (True, False)]
    sheet = strip(rows, 3)
    assert sheet.shape == (110 + 2 + 110, 3 * 80 + 2 * 2, 3)
    assert (sheet[110:112] == 255).all()
    assert (sheet[:, 80:82] == 255).all()
    # All at one scale: of the scene with two figures, which has to be seen from further away.
    wide, alone = rows
    alone = replace(alone, camera=wide.camera)
    for column, frame in enumerate((0, 25, 50)):
        panel = np.s_[:, column * 82 : column * 82 + 80]
        assert np.array_equal(sheet[:110][panel], wide.picture(frame))
        found = strip([wide, alone], 3)[112:][panel]
        assert np.array_equal(sheet[112:][panel], found)
        assert not np.array_equal(found, rows[1].picture(frame))


def test_rows_of_one_scale_show_who_is_taller(run: Run) -> None:
    heights = []
    assert run.mesh is not None
    skin = skin_surface(run.mesh, RED)
    small = replace(skin, vertices=0.7 * skin.vertices, joints=0.7 * skin.joints)
    lower = run.trajectory.q * np.r_[0.7, 0.7, 0.7, np.ones(54)]
    scenes = [stage([make_actor(s, q)], 100.0, PANEL) for s, q in ((skin, run.trajectory.q), (small, lower))]
    sheet = strip(scenes, 1)
    for row in (sheet[:110], sheet[112:]):
        heights.append(np.ptp(np.flatnonzero(red(row).any(axis=1))) + 1)
    assert heights[0] > 75
    assert heights[1] / heights[0] == pytest.approx(0.7, abs=0.04)


def test_a_strip_has_no_more_panels_than_frames(run: Run) -> None:
    sheet = strip([red_scene(run), red_scene(run, frames=2)], 5)
    assert sheet.shape == (222, 5 * 80 + 4 * 2, 3)
    assert red(sheet[112:, :162]).any()
    assert (sheet[112:, 162:] == 255).all()
    assert strip([red_scene(run, frames=1)], 5).shape == (110, 80, 3)


def test_each_panel_has_its_time_and_names(run: Run) -> None:
    scene = stage_runs([run], (160, 200), source=True, capsules=True)
    plain = np.concatenate([scene.picture(t, caption=False) for t in (0, 50)], axis=1)
    sheet = strip([scene], 2)
    sheet = np.concatenate([sheet[:, :160], sheet[:, 162:]], axis=1)
    changed = (plain != sheet).any(axis=2)
    assert changed[185:, :60].any()  # the time
    assert changed[185:, 160:220].any()
    assert not np.array_equal(changed[185:, :60], changed[185:, 160:220])
    for figure in (np.s_[:40, :80], np.s_[:40, 80:160]):
        assert changed[figure].any()  # the names
    assert not changed[60:180].any()


@pytest.mark.parametrize("capsules", [False, True])
def test_what_is_held_is_seen(armed_run: Run, capsules: bool) -> None:
    """The picture differs along the stick from that of a man who holds nothing."""
    scene = stage_runs([armed_run], (200, 200), capsules=capsules, azimuth=-50.0)
    (actor,), (geom,) = scene.actors, armed_run.held()
    stick = (actor.surface.colours == geom.rgb).all(axis=1)
    assert stick.any()
    faces = actor.surface.faces[~stick[actor.surface.faces].any(axis=1)]
    bare = replace(scene, actors=(replace(actor, surface=replace(actor.surface, faces=faces)),))
    changed = (strip([scene], 3) != strip([bare], 3)).any(axis=2)
    for column, frame in enumerate((0, 25, 50)):
        at = scene.camera.follow(scene.route[frame]).project(actor.vertices(frame)[stick], scene.size)
        x, y = at.astype(int).T
        assert changed[y, x + column * 202].mean() > 0.7


def test_sheets_that_cannot_be_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match="no scenes"):
        strip([])
    with pytest.raises(InputError, match="80 x 110, 110 x 80"):
        strip([red_scene(run), red_scene(run, (110, 80))])


def test_animations_that_cannot_be_are_refused(run: Run, tmp_path: Path) -> None:
    scene = red_scene(run, frames=3)
    with pytest.raises(InputError, match=r"x\.mp4: found suffix '\.mp4'"):
        animation(tmp_path / "x.mp4", scene)
    with pytest.raises(InputError, match="rate: found 0 a second"):
        animation(tmp_path / "x.gif", scene, 0.0)
    with pytest.raises(InputError, match=r"no such file or directory"):
        animation(tmp_path / "gone" / "x.gif", scene)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("suffix", "rate", "lasts"), [("gif", 10.0, [100] * 3), ("webp", 30.0, [30, 40, 30] * 2)]
)
def test_an_animation_has_true_speed(
    run: Run, tmp_path: Path, suffix: str, rate: float, lasts: list[int]
) -> None:
    scene = red_scene(run, (100, 80), 21)
    path = animation(tmp_path / f"x.{suffix}", scene, rate, threads=1)
    with PillowImage.open(path) as film:
        assert film.size == (100, 80)
        assert film.info["loop"] == 0
        at = 0
        for index, lasting in enumerate(lasts):
            film.seek(index)
            film.load()
            assert film.info["duration"] == pytest.approx(lasting)
            shown = np.asarray(film.convert("RGB"))
            wanted = scene.picture(at // 10, caption=False)
            assert (red(shown) ^ red(wanted)).sum() < 0.2 * red(wanted).sum()
            at += lasting
        assert film.n_frames >= len(lasts)
    again = animation(tmp_path / f"y.{suffix}", scene, rate, threads=3)
    assert again.read_bytes() == path.read_bytes()


def test_a_ghost_is_paler_than_who_follows_it(run: Run) -> None:
    scene = stage_runs([run], (200, 150), source=True, capsules=True)
    picture, empty = (
        s.picture(20, caption=False).astype(float)
        for s in (scene, stage([replace(a, ghost=True) for a in scene.actors], 100.0, (200, 150)))
    )
    camera = scene.camera.follow(scene.route[20])
    strength = []
    for actor in scene.actors:
        x, y = camera.project(actor.joints(51)[20, 6], scene.size).astype(int)
        strength.append(np.ptp(picture[y - 3 : y + 4, x - 2 : x + 3], axis=2).mean())
    assert strength[0] < 20 < strength[1]
    assert np.abs(picture - empty).max() > 50


def test_a_body_is_seen_as_skin_and_capsules_from_front_and_left(run: Run) -> None:
    assert run.mesh is not None
    picture = body_picture(run.mesh, run.body, 240)
    height, width = picture.shape[:2]
    assert height == 240
    assert 2 * height < width < 3 * height
    image = picture.astype(int)
    warm, cold = image[..., 0] - image[..., 2] > 25, image[..., 2] - image[..., 0] > 45
    columns = np.flatnonzero((warm | cold).any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    spans = [(g[0], g[-1] + 1) for g in groups if len(g) > 5]
    assert len(spans) == 4
    tops = [np.flatnonzero((warm | cold)[:, a:b].any(axis=1))[0] for a, b in spans]
    assert np.ptp(tops) <= 3  # one scale
    wide = [b - a for a, b in spans]
    assert wide[0] == pytest.approx(wide[1], rel=0.05)
    assert max(wide[2:]) < 0.4 * wide[0]  # no arms to the sides
    # Only capsules have a blue left, on the right of the picture as seen from before.
    assert [cold[:, a:b].sum() > 100 for a, b in spans] == [False, True, False, True]
    a, b = spans[1]
    assert cold[:, (a + b) // 2 : b].sum() > 10 * cold[:, a : (a + b) // 2].sum()
    # All stand on the floor: feet end at one row, as near to the lower edge as the head to the upper.
    feet = [np.flatnonzero((warm | cold)[:, a:b].any(axis=1))[-1] for a, b in spans]
    assert np.ptp(feet) <= 6
    assert min(feet) > 0.85 * height

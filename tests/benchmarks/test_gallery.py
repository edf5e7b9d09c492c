from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import gallery
from physique.body.named import named_body
from physique.character.model import Character
from physique.reference.reference import Reference
from physique.runs.run import Run
from physique.tracking.trajectory import Trajectory


@pytest.fixture(scope="module")
def shown_run(character: Character, walk: Reference) -> Run:
    """Half a second of the walk as if it had been simulated."""
    nothing = np.zeros((50, 50))
    motion = Trajectory(
        np.arange(51) * walk.timestep,
        walk.q[:51],
        walk.v[:51],
        nothing,
        nothing,
        walk.q[:51],
        np.zeros((51, 2)),
    )
    record = {"identity": {"clip": "walk"}}
    return Run(record, {}, motion, character.xml, character.body, named_body("average"))


def test_the_camera_stands_still_and_sees_all(shown_run: Run) -> None:
    scene = gallery._stage([shown_run, shown_run], ["one", "other"], (200, 120), 30, 6)
    assert [actor.label for actor in scene.actors] == ["one", "other"]
    assert (scene.route == scene.route[0]).all()
    camera = scene.camera.follow(scene.route[0])
    for actor in scene.actors:
        for frame in range(scene.frames):
            seen = camera.project(actor.vertices(frame), scene.size)
            assert (seen >= 0).all()
            assert (seen <= scene.size).all()


def test_a_part_of_a_run_is_shown(shown_run: Run) -> None:
    scene = gallery._stage([shown_run], ["one"], (200, 120), 30, 6, seconds=0.3)
    assert scene.frames == 31
    assert [t for _, t in gallery._film(scene)] == [0, 6, 12, 18, 24, 30]
    assert [t for _, t in gallery._film(scene, slow=2)][:3] == [0, 3, 6]


def test_a_film_has_its_pictures_and_times(shown_run: Run, tmp_path: Path) -> None:
    film = gallery._film(gallery._stage([shown_run], ["one"], (160, 120), 30, 6))
    quality = gallery.write_webp(tmp_path / "film.webp", film)
    assert quality == max(gallery.QUALITIES)
    with Image.open(tmp_path / "film.webp") as shown:
        assert shown.n_frames == len(film)
        assert shown.size == (160, 120)
        times, pictures = [], []
        for number in range(shown.n_frames):
            shown.seek(number)
            pictures.append(np.asarray(shown.convert("RGB"), dtype=float))
            times.append(shown.info["duration"])
    assert times == [60] * (len(film) - 1) + [1000]
    scene, frame = film[-1]
    assert np.abs(pictures[-1] - scene.picture(frame)).mean() < 5.0


def test_a_push_needs_a_policy(tmp_path: Path) -> None:
    with pytest.raises(gallery.MissingError):
        gallery.push(tmp_path)

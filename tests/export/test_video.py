"""Videos: PyAV reads back what was drawn."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from physique.errors import InputError
from physique.export.video import write_video
from physique.render.scene import stage_runs
from physique.runs.run import Run

av = pytest.importorskip("av", reason="needs PyAV: pip install 'physique[video]'")

SIZE = (160, 120)


def test_the_frames_are_the_scene_at_true_speed(run: Run, tmp_path: Path) -> None:
    path = write_video(tmp_path / "walk.mp4", [run], source=True, size=SIZE)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.average_rate == 25
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 13  # 0.5 s and the first
    scene = stage_runs([run], SIZE, source=True)
    for k in (0, 5, 12):
        wanted = scene.picture(4 * k).astype(int)
        assert np.abs(frames[k].astype(int) - wanted).mean() < 4


def test_the_rate_can_be_chosen(run: Run, tmp_path: Path) -> None:
    path = write_video(tmp_path / "walk.mp4", [run], capsules=True, size=SIZE, rate=12.5)
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == 12.5
        assert sum(1 for _ in container.decode(video=0)) == 7


@pytest.mark.parametrize(("size", "text"), [((161, 120), "even numbers"), ((8, 8), "16 to 4096")])
def test_sizes_that_cannot_be_are_refused(run: Run, tmp_path: Path, size: tuple[int, int], text: str) -> None:
    with pytest.raises(InputError, match=text):
        write_video(tmp_path / "walk.mp4", [run], size=size)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_package_is_asked_for_in_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"pip install 'physique\[video\]'"):
        write_video(tmp_path / "walk.mp4", [run])
    assert list(tmp_path.iterdir()) == []

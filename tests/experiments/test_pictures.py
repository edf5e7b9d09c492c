"""Pictures of the experiments show both controllers beside the motion that they should keep to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from physique.experiments import fig6, recovery
from physique.feedback.pushes import Trial
from physique.runs.run import Run
from physique.simulation.rollout import Rollout
from physique.simulation.stepper import Push


@pytest.mark.parametrize("skin", [True, False])
def test_a_recovery_is_drawn_from_the_push_on(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, skin: bool
) -> None:
    monkeypatch.setattr(fig6, "PANEL", (80, 80))
    monkeypatch.setattr(fig6, "PANELS", 2)
    pytest.importorskip("av")
    shown = run if skin else replace(run, mesh=None)
    motion, start = run.trajectory, 41
    push = Push(0, (0.0, 0.0, 0.0), start, 10)
    trials = {}
    for name in ("lqr", "tree"):
        steps, still = slice(start, None), np.zeros((len(motion.q) - start, 3))
        did = Rollout(
            motion.q[steps], motion.v[steps], motion.control[steps], motion.torque[steps], still, still, False
        )
        trials[name] = Trial(push, True, 0.0, None, 0.0, (), did, np.zeros((len(still), 22, 3)))
    sheet, video = recovery.draw(shown, trials, tmp_path)
    assert video.stat().st_size > 1000
    with Image.open(sheet) as picture:
        assert picture.size == (2 * 82 - 2, 2 * 82 - 2)
        rows = np.split(np.asarray(picture).astype(int), [80, 82])[::2]
    for row, warm in zip(rows, (True, False)):
        excess = (row[..., 0] - row[..., 2]) * (1 if warm else -1)
        assert (excess[:, :80] > 40).sum() > 50  # tan and blue, or the colours of the sides

"""A run's policy is its own, or none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physique.errors import InputError
from physique.feedback.tree import Tree, save_policy, trunk
from physique.live.controllers import controllers_of
from physique.runs.run import POLICY, Run, finish_run, load_run


@pytest.fixture
def stored(run: Run, tmp_path: Path) -> Run:
    finish_run(tmp_path, run)
    return load_run(tmp_path)


def plain(run: Run) -> Tree:
    """The run's motion with feedback that does nothing."""
    motion, none = run.trajectory, np.zeros((run.trajectory.frames, 3))
    gains = np.zeros((motion.frames - 1, 50, 112))
    return trunk(motion.q, motion.v, motion.control, none, none, gains)


def test_its_own_is_taken(stored: Run) -> None:
    with pytest.raises(InputError, match=r"found no policy; .*physique stabilize"):
        stored.policy()
    assert list(controllers_of(stored)) == ["replay"]
    assert stored.folder is not None
    save_policy(stored.folder / POLICY, stored.character_xml, plain(stored), {})
    assert stored.policy().controller == "lqr"
    assert stored.policy("pd").controller == "pd"
    assert list(controllers_of(stored)) == ["replay", "lqr"]
    with pytest.raises(InputError, match="without a tree"):
        stored.policy("tree")


@pytest.mark.parametrize("name", ["q", "v", "frames", "model"])
def test_that_of_another_motion_or_body_is_refused(stored: Run, name: str) -> None:
    motion, xml = stored.trajectory, stored.character_xml
    if name == "frames":
        other = plain(replace(stored, trajectory=motion.beginning(motion.frames - 5)))
    elif name == "model":
        other, xml = plain(stored), xml.replace('model="average"', 'model="other"')
    else:
        moved = getattr(motion, name).copy()
        moved[3, 0] += 1e-9
        other = plain(replace(stored, trajectory=replace(motion, **{name: moved})))
    assert stored.folder is not None
    save_policy(stored.folder / POLICY, xml, other, {})
    for ask in (stored.policy, stored.policy_file, lambda: controllers_of(stored)):
        with pytest.raises(InputError, match=r"policy\.npz: found a policy of another motion or body"):
            ask()


def test_a_run_in_memory_has_none(run: Run) -> None:
    assert run.policy_file() is None
    with pytest.raises(InputError, match="no policy"):
        run.policy()

"""What all tests share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from physique import metrics
from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.motion.read import read_motion
from physique.run import Run
from physique.simulation.character import Character, make_character
from physique.simulation.quiet import quiet
from physique.tracking.costs import Weights
from physique.tracking.reference import Reference, make_reference
from physique.tracking.trajectory import join
from physique.tracking.windows import Window

MOCAP = Path(__file__).resolve().parents[2] / "shared" / "mocap"


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real clips, which stands beside the repository and is not part of it."""
    if not (MOCAP / "MANIFEST.tsv").is_file():
        pytest.skip("needs real motion-capture clips in ../shared/mocap beside the repository")
    return MOCAP


@pytest.fixture(scope="session", autouse=True)
def _quiet() -> Iterator[None]:
    """Tests that blow a simulation up, on purpose or not, need no log file of it."""
    with quiet():
        yield


@pytest.fixture(scope="session")
def character() -> Character:
    """The average body, 100 Nm at every joint."""
    return make_character(capsule_body(named_body("average")), 100.0)


@pytest.fixture(scope="session")
def walk(character: Character) -> Reference:
    """The embedded walk on the average body."""
    return make_reference(read_motion("walk"), character)


@pytest.fixture(scope="session")
def made_run(character: Character, walk: Reference) -> Run:
    """A run of half a second that nothing simulated: the walk with a sway, all its parts in place.

    For tests of what is done with a run: `trajectory.q` differs from `reference_q`, two windows,
    the second of them hard, torques of which some are at their limit.
    """
    frames = 51
    random = np.random.default_rng(5)
    q = walk.q[:frames].copy()
    sway = np.linspace(0.0, 0.2, frames)
    q[:, 1] += 0.1 * sway
    q[:, 7:] += sway[:, None] * random.normal(size=50)
    share = np.clip(random.normal(scale=0.4, size=(frames - 1, 50)), -1.0, 1.0)
    parts = [(0, 30, {"com": 0.2, "pose": 0.5}), (30, 50, {"com": 11.0, "pose": 14.0})]
    windows = [
        Window(
            start=start, stop=stop, q=q[start : stop + 1], v=walk.v[start : stop + 1],
            control=q[start + 1 : stop + 1, 7:],
            torque=share[start:stop] * character.torque_limit, shift=np.zeros(2),
            tail_q=q[-2:], tail_v=walk.v[:2], tail_control=q[-2:, 7:], terms=terms,
            cost=sum(terms.values()), iterations=3, sim_steps=100, status="converged",
        )
        for start, stop, terms in parts
    ]  # fmt: skip
    trajectory = join(walk, q[0], walk.v[0], windows)
    measured = metrics.measure(character, walk, trajectory, windows, Weights())
    effort = {"sim_steps": 200, "sim_steps_per_motion_s": 400.0, "wall_s": 1.0}
    return Run(
        record={
            "identity": {"clip": "walk", "body": "average", "optimizer": "fast", "seed": 0,
                         "versions": {"physique": "0", "mujoco": "0"}},
            "clip_source": "walk (embedded)",
        },
        metrics={**measured, **effort, "wall_s_per_motion_s": 2.0, "seed": 0,
                 "versions": {"physique": "0", "mujoco": "0"}, "body_height_m": 1.75,
                 "body_mass_kg": 75.0},
        trajectory=trajectory,
        character_xml=character.xml,
        body=character.body,
        mesh=named_body("average"),
    )  # fmt: skip

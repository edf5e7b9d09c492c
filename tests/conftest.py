"""What all tests share."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from physique.body.build import capsule_body
from physique.body.held import Held, parse_held
from physique.body.named import named_body
from physique.character.model import Character, make_character
from physique.character.servo import within_limits
from physique.character.start import start_state
from physique.motion.read import read_motion
from physique.reference.reference import Reference, make_reference
from physique.reference.target import Weights
from physique.runs import metrics
from physique.runs.run import Run
from physique.simulation.process import quiet
from physique.simulation.rollout import simulate
from physique.simulation.stepper import Stepper
from physique.tracking.trajectory import join
from physique.tracking.windows import Window

Array = NDArray[np.float64]

#: Fixtures of reports and of the live page.
pytest_plugins = ["pages"]

MOCAP = Path(__file__).resolve().parents[2] / "shared" / "mocap"


@pytest.fixture(autouse=True, scope="session")
def _ctrl_c_reaches_children() -> None:
    """Processes that a shell starts in the background ignore Ctrl-C, and so would their own."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


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
def run(character: Character, walk: Reference) -> Run:
    """A run of half a second, for tests of what is done with a run.

    Real physics without an optimiser: the average body, led by the angles of the walk alone. Two
    windows, the second of them hard.
    """
    return follow(character, walk)


@pytest.fixture(scope="session")
def armed_run(character: Character, walk: Reference) -> Run:
    """The same with a stick in the right hand."""
    held = parse_held("stick:2kg", "right")
    return follow(make_character(character.body, 100.0, held), walk, held)


def follow(character: Character, walk: Reference, held: Held | None = None) -> Run:
    """Let the character follow the reference's angles, and measure it as a run is measured."""
    frames = 51
    q0, v0 = start_state(character, walk.q[0], walk.v[0], walk.contacts[0])

    def lead(t: int, q: Array, v: Array) -> Array:
        return within_limits(character, walk.q[t + 1, 7:], q, v)

    made = simulate(Stepper(character.model), q0, v0, frames - 1, lead)[0]
    assert not made.diverged
    parts = [(0, 30, {"com": 0.2, "pose": 0.5}), (30, 50, {"com": 11.0, "pose": 14.0})]
    windows = [
        Window(
            start=start,
            stop=stop,
            q=made.q[start : stop + 1],
            v=made.v[start : stop + 1],
            control=made.control[start:stop],
            torque=made.torque[start:stop],
            shift=np.zeros(2),
            tail_q=made.q[-2:],
            tail_v=made.v[-2:],
            tail_control=made.control[-2:],
            terms=terms,
            cost=sum(terms.values()),
            iterations=3,
            sim_steps=100,
            status="converged",
        )
        for start, stop, terms in parts
    ]
    trajectory = join(walk, made.q[0], made.v[0], windows)
    measured = metrics.measure(character, walk, trajectory, windows, Weights())
    effort = {"sim_steps": 200, "sim_steps_per_motion_s": 400.0, "wall_s": 1.0}
    return Run(
        record={
            "identity": {
                "clip": "walk",
                "body": "average",
                "optimizer": "fast",
                "seed": 0,
                "hold": None if held is None else str(held),
                "hand": None if held is None else held.hand,
                "versions": {"physique": "0", "mujoco": "0"},
            },
            "clip_source": "walk (embedded)",
        },
        metrics={
            **measured,
            **effort,
            "wall_s_per_motion_s": 2.0,
            "seed": 0,
            "versions": {"physique": "0", "mujoco": "0"},
            "body_height_m": 1.75,
            "body_mass_kg": 75.0,
        },
        trajectory=trajectory,
        character_xml=character.xml,
        body=character.body,
        mesh=named_body("average"),
    )


@dataclass(frozen=True)
class Moment:
    """A state q (57,), v (56,) and a control u (50,)."""

    q: Array
    v: Array
    u: Array


@pytest.fixture(scope="session")
def moments(character: Character, walk: Reference) -> list[Moment]:
    """Walking states with feet on the floor, a few simulated steps after the reference's."""
    model = character.model
    data = mujoco.MjData(model)
    out = []
    for t in (22, 45, 130, 190):
        data.qpos[:], data.qvel[:] = walk.q[t], walk.v[t]
        for _ in range(3):
            data.ctrl[:] = within_limits(character, walk.q[t + 1, 7:], data.qpos, data.qvel)
            mujoco.mj_step(model, data)
        q, v = data.qpos.copy(), data.qvel.copy()
        out.append(Moment(q, v, within_limits(character, walk.q[t + 1, 7:], q, v)))
    return out


@pytest.fixture(scope="session")
def step(character: Character) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """One `mj_step` of plain MuJoCo."""
    data = mujoco.MjData(character.model)

    def run(q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        mujoco.mj_resetData(character.model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
        mujoco.mj_step(character.model, data)
        return data.qpos.copy(), data.qvel.copy()

    return run

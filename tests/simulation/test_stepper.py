"""The one loop over MuJoCo's step, and its test of divergence."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from threadpoolctl import threadpool_info

from physique.character import kinematics
from physique.character.model import Character
from physique.reference.reference import Reference
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.probes import Probes
from physique.simulation.process import ProcessSetting, silence
from physique.simulation.rollout import simulate
from physique.simulation.stepper import Push, Stepper

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")

#: What MuJoCo resets at once, what it resets within the step, and what it ignores.
FAULTS = {"speed": 1e11, "acceleration": 1e9, "control": np.nan}


def faulty(walk: Reference, fault: str, at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A state (57,), (56,) and control (10, 50) that blow up in step `at`; states only in the first."""
    q, v, control = walk.q[20], walk.v[20].copy(), np.tile(walk.q[20, 7:], (10, 1))
    if fault == "control":
        control[at, 3] = FAULTS[fault]
    else:
        assert at == 0
        v[6:] = FAULTS[fault]
    return q, v, control


@pytest.mark.parametrize(
    ("fault", "at"), [("speed", 0), ("acceleration", 0), ("control", 0), ("control", 4), ("control", 9)]
)
def test_every_way_to_step_notices_a_blow_up(
    character: Character, walk: Reference, fault: str, at: int
) -> None:
    q, v, control = faulty(walk, fault, at)
    with MujocoSimulator(character, 1) as simulator:
        run = simulator.run(q, v, 10, [lambda t, q, v: control[t]])[0]
        performed = simulator.perform(q, v, 10, lambda t, q, v: control[t], Push(9, (1.0, 0.0, 0.0), 0, 2))
        many = simulator.run_open_loop(q, v, np.stack([control, np.tile(walk.q[20, 7:], (10, 1))]))
    assert run.diverged
    assert performed.diverged
    assert len(performed.q) == at + 1
    assert len(performed.control) == at
    assert np.isfinite(run.q).all()
    assert np.array_equal(run.q[at:], np.tile(run.q[at], (11 - at, 1)))
    assert many.diverged[0]
    assert many.diverged[1] == (fault != "control")


def test_candidates_that_blow_up_have_fallen(character: Character, walk: Reference) -> None:
    q, v, control = faulty(walk, "speed", 0)
    probes = Probes(character.model, 1)
    probes.start(q, v, 3)
    probes.run(4, lambda q, v: np.tile(control[0], (len(q), 1)), lowest=0.1)
    assert probes.fallen.all()
    assert list(probes.steps) == [1, 1, 1]


def test_an_observer_sees_each_step_and_ends_it(character: Character, walk: Reference) -> None:
    seen = []

    def watch(t: int, now: Stepper) -> bool:
        seen.append(now.joints)
        return t < 6

    with MujocoSimulator(character, 1) as simulator:
        made = simulator.perform(walk.q[20], walk.v[20], 20, lambda t, q, v: walk.q[20, 7:], observe=watch)
        assert simulator.steps == 7
    assert len(made.q) == len(seen) == 7
    assert len(made.torque) == 6
    np.testing.assert_allclose(np.array(seen), kinematics.joint_positions(character, made.q), atol=1e-12)


def test_pushes_act_in_their_time_alone(character: Character, walk: Reference) -> None:
    """Against plain MuJoCo, in which the force is set by hand; a point at the centre is the centre."""
    force, start, steps = (60.0, -30.0, 20.0), 3, 5
    body = character.joint_bodies[9]
    centre = tuple(character.model.body_ipos[body])
    stepper = Stepper(character.model)
    hold = walk.q[20, 7:]
    made = [
        simulate(stepper, walk.q[20], walk.v[20], 12, lambda t, q, v: hold, Push(9, force, start, steps, at))[
            0
        ]
        for at in (None, centre)
    ]
    data = mujoco.MjData(character.model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = walk.q[20], walk.v[20], hold
    for t in range(12):
        data.xfrc_applied[body, :3] = force if start <= t < start + steps else 0.0
        mujoco.mj_step(character.model, data)
    assert np.array_equal(made[0].q[-1], data.qpos)
    np.testing.assert_allclose(made[1].q[-1], data.qpos, atol=1e-9)


def test_settings_of_the_process_end_with_their_last_user() -> None:
    value = ["before"]

    def apply():
        old, value[0] = value[0], "during"
        return lambda: value.__setitem__(0, old)

    setting = ProcessSetting(apply)
    setting.__enter__()
    setting.__enter__()
    setting.__exit__()
    assert value == ["during"]
    setting.__exit__()
    assert value == ["before"]


def test_simulators_that_overlap_restore_the_threads_of_blas(character: Character) -> None:
    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    before = threads()
    first, second = MujocoSimulator(character, 1), MujocoSimulator(character, 1)
    assert set(threads()) == {1}
    first.close()
    assert set(threads()) == {1}
    second.close()
    second.close()  # once more is no more
    assert threads() == before
    with MujocoSimulator(character, 1):
        assert set(threads()) == {1}


def test_messages_are_on_again_after_the_last_quiet() -> None:
    def console(loud: bool | None = None) -> bool:
        config = mujoco.MjLogConfig.get()
        if loud is not None:
            config.logto_console = loud
            mujoco.MjLogConfig.set(config)
        return bool(config.logto_console)

    before, silent = console(), ProcessSetting(silence)
    console(True)
    try:
        with silent:
            assert not console()
        assert console()
    finally:
        console(before)

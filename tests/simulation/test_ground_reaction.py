"""Forces of the floor: they carry the body that stands, and obey Newton where it moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.character import kinematics, state
from physique.character.model import Character
from physique.character.servo import within_limits
from physique.character.soles import sole_points
from physique.character.start import start_state
from physique.reference.reference import Reference
from physique.simulation.ground_reaction import ground_reaction
from physique.simulation.rollout import Rollout, simulate
from physique.simulation.stepper import Stepper

Array = NDArray[np.float64]

GRAVITY = np.array([0.0, 0.0, 9.81])


def played(character: Character, walk: Reference, first: int, steps: int) -> Rollout:
    """Steps from a frame of the walk, led by its angles alone."""
    q, v = start_state(character, walk.q[first], walk.v[first], walk.contacts[first])

    def follow(t: int, q: Array, v: Array) -> Array:
        return within_limits(character, walk.q[first + t + 1, 7:], q, v)

    return simulate(Stepper(character.model), q, v, steps, follow)[0]


def com_acceleration(character: Character, made: Rollout) -> Array:
    """(N, 3) m/s2 that each step gives the centre of mass: J dv / dt + dJ/dt v."""
    q, v, h = made.q[:-1], made.v[:-1], 1e-6
    ahead, behind = (kinematics.com_jacobian(character, state.integrate(q, sign * h * v)) for sign in (1, -1))
    dt = float(character.model.opt.timestep)
    change = np.diff(made.v, axis=0) / dt
    return kinematics.com_velocity(kinematics.com_jacobian(character, q), change) + kinematics.com_velocity(
        (ahead - behind) / (2 * h), v
    )


def test_mass_times_acceleration_is_weight_and_floor(character: Character, walk: Reference) -> None:
    made = played(character, walk, 0, 60)
    floor = ground_reaction(character, made.q, made.v, made.control)
    wanted = character.mass * (com_acceleration(character, made) + GRAVITY)
    assert floor.total[:, 2].max() > character.mass * 9.81
    assert np.abs(floor.total - wanted).max() < 2e-4 * np.abs(wanted).max()


def test_a_body_that_stands_weighs_on_its_soles(character: Character, walk: Reference) -> None:
    """The T-pose, let down onto the floor, stands for a while."""
    q = np.zeros(57)
    q[:3], q[3] = character.body.joints[0], 1.0
    rest = q[7:].copy()
    made, _ = simulate(
        Stepper(character.model), q, np.zeros(56), 40, lambda t, q, v: within_limits(character, rest, q, v)
    )
    floor = ground_reaction(character, made.q, made.v, made.control)
    weight = character.mass * 9.81
    # After the landing's tremor, over the last quarter of a second.
    assert abs(floor.total[15:, 2].mean() - weight) < 0.02 * weight
    assert np.abs(floor.other).max() == 0.0
    share = floor.feet[15:, :, 2].mean(axis=0) / weight
    assert np.abs(share - 0.5).max() < 0.05
    soles = sole_points(character, made.q[15:-1])[..., :2]
    assert (floor.pressure[15:] >= soles.min(axis=2) - 1e-3).all()
    assert (floor.pressure[15:] <= soles.max(axis=2) + 1e-3).all()


def test_a_foot_in_the_air_has_no_centre_of_pressure(character: Character, walk: Reference) -> None:
    made = played(character, walk, 0, 60)
    floor = ground_reaction(character, made.q, made.v, made.control)
    up = floor.feet[..., 2]
    assert (up == 0.0).any()
    assert (up > 100.0).any()
    assert np.array_equal(np.isnan(floor.pressure[..., 0]), up <= 1.0)


def test_other_parts_are_counted_apart(character: Character) -> None:
    """A body that lies on its back."""
    q = np.zeros(57)
    q[2], q[3:7] = 0.25, [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
    made, _ = simulate(
        Stepper(character.model),
        q,
        np.zeros(56),
        60,
        lambda t, q, v: within_limits(character, np.zeros(50), q, v),
    )
    floor = ground_reaction(character, made.q, made.v, made.control)
    assert floor.other[-20:, 2].mean() > 0.5 * character.mass * 9.81

"""Eq. 1: position targets, the torques they ask for, and the limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.character.model import Character

Array = NDArray[np.float64]


def within_limits(character: Character, control: Array, q: Array, v: Array) -> Array:
    """Position targets (..., 50) moved so that the PD torque at (q, v) stays inside the limits.

    A target beyond the limit gives the same torque but no derivative; at the limit it keeps both.
    """
    offset = control - q[..., 7:]
    damping = character.damping * v[..., 6:]
    limit = usable_limit(character)
    torque = character.stiffness * offset - damping
    return q[..., 7:] + (np.clip(torque, -limit, limit) + damping) / character.stiffness


def pd_torque(character: Character, control: Array, q: Array, v: Array) -> Array:
    """Eq. 1 within the limits: torques (..., 50), Nm."""
    torque = character.stiffness * (control - q[..., 7:]) - character.damping * v[..., 6:]
    return np.clip(torque, -character.torque_limit, character.torque_limit)


def usable_limit(character: Character) -> Array:
    """Torques (50,), Nm, just inside the limits: there a target still has its derivative."""
    return character.torque_limit * (1.0 - 1e-6)

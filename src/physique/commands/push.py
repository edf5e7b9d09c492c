"""Pushes at random on a run's character, and how its policy stands them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from physique.errors import InputError
from physique.feedback.policy import ControllerName
from physique.feedback.pushes import Trial, random_pushes, run_trials
from physique.runs.run import load_run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.store import PathLike

#: Pushes come at the latest this long before the motion's end, so that a fall is seen.
MARGIN = 1.5  # s


@dataclass(frozen=True)
class PushReport:
    """Trials of one impulse; the fields are the keys of `physique push --json`.

    controller: that performed. survival: 0 to 1. median_recovery_s: of those that survived; None where
    half of them or more have not recovered by the motion's end. delta_v: m/s, impulse by mass.
    decision_ms: of one online decision, None without one. realtime_factor: s of motion a second.
    """

    controller: ControllerName
    trials: int
    survived: int
    survival: float
    median_recovery_s: float | None
    impulse_ns: float
    delta_v: float
    decision_ms: dict[str, float] | None
    realtime_factor: float


def push(
    folder: PathLike,
    impulse: float,
    *,
    duration: float = 0.1,
    trials: int = 100,
    seed: int = 0,
    controller: ControllerName | None = None,
    start: float | None = None,
    end: float | None = None,
    on_trial: Callable[[int, Trial], None] | None = None,
) -> tuple[PushReport, list[Trial]]:
    """Push a run's character at random and see whether it survives.

    impulse: Ns, on a random part in a random direction, over `duration` s, beginning at a random
        time between start and end, s; left out, from the beginning to 1.5 s before the motion's
        end. seed: of the pushes. controller: left out, the best that the policy has.

    Survival: the mean body position error is at most 0.5 m until the motion's end. Raises
    InputError for a run without a policy and for values that do not fit it.
    """
    run = load_run(folder)
    policy = run.policy(controller)
    _check("impulse", impulse, 0.0, 1e5, "Ns")
    _check("duration", duration, policy.timestep, policy.seconds, "s")
    _check("trials", trials, 1, 1e6, "")
    _check("seed", seed, 0, 2**32 - 1, "")
    last = policy.seconds - duration
    first_s = 0.0 if start is None else start
    last_s = max(first_s, policy.seconds - MARGIN) if end is None else end
    _check("from", first_s, 0.0, last, "s")
    _check("to", last_s, first_s, last, "s")
    pushes = random_pushes(
        np.random.default_rng(seed),
        trials,
        impulse,
        max(1, round(duration / policy.timestep)),
        (round(first_s / policy.timestep), round(last_s / policy.timestep)),
        policy.timestep,
    )
    character = run.character()
    with quiet(), MujocoSimulator(character, 1) as simulator:
        done, factor = run_trials(simulator, policy, pushes, on_trial)
    return report(policy.controller, done, impulse, character.mass, factor), done


def report(
    controller: ControllerName, trials: list[Trial], impulse: float, mass: float, factor: float
) -> PushReport:
    """The trials in a few numbers."""
    survived = sum(t.survived for t in trials)
    recovery = [math.inf if t.recovery is None else t.recovery for t in trials if t.survived]
    middle = float(np.median(recovery)) if recovery else math.inf
    decisions = [1e3 * s for t in trials for s in t.decisions]
    return PushReport(
        controller=controller,
        trials=len(trials),
        survived=survived,
        survival=survived / len(trials),
        median_recovery_s=middle if math.isfinite(middle) else None,
        impulse_ns=impulse,
        delta_v=impulse / mass,
        decision_ms={"median": float(np.median(decisions)), "worst": max(decisions)} if decisions else None,
        realtime_factor=factor,
    )


def _check(name: str, value: float, least: float, most: float, unit: str) -> None:
    if not (math.isfinite(value) and least <= value <= most + 1e-9):
        raise InputError(
            f"--{name}", f"{value:g} {unit}", f"{least:g} to {most:g} {unit}", "correct the value"
        )

"""What the files of a finished run must hold."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.tracking.trajectory import Trajectory

#: Rows beside T frames, and columns.
_SHAPES: dict[str, tuple[int, ...]] = {
    "times": (0,),
    "q": (0, 57),
    "v": (0, 56),
    "control": (-1, 50),
    "torque": (-1, 50),
    "reference_q": (0, 57),
    "shift": (0, 2),
}
_UNIT = 1e-6  # how far a quaternion's norm may be from 1
_LATE = 1e-9  # s


def read_trajectory(path: Path, arrays: Mapping[str, NDArray[Any]], timestep: float) -> Trajectory:
    """The trajectory that the arrays of the file `path` are, frames `timestep` s apart.

    Raises InputError where arrays are missing, of another type or shape, or not finite, where a
    quaternion has not the length 1, or the times are not those of the steps.
    """
    names = {field.name for field in dataclasses.fields(Trajectory)}
    if names != arrays.keys():
        missing, more = sorted(names - arrays.keys()), sorted(arrays.keys() - names)
        found = f"no {', '.join(missing)}" if missing else f"{', '.join(more)} too"
        raise _refusal(path, found, f"the arrays {', '.join(sorted(names))}")
    frames = len(np.atleast_1d(arrays["times"]))
    for name, (more_rows, *columns) in _SHAPES.items():
        array, shape = arrays[name], (frames + more_rows, *columns)
        if array.dtype != np.float64:
            raise _refusal(path, f"{name} of type {array.dtype}", "float64")
        if frames < 1 or array.shape != shape:
            raise _refusal(path, f"{name} of shape {array.shape}", f"{shape}")
        if not np.isfinite(array).all():
            raise _refusal(path, f"numbers in {name} that are not finite", "finite ones")
    for name in ("q", "reference_q"):
        if np.abs(np.linalg.norm(arrays[name][:, 3:7], axis=1) - 1.0).max() > _UNIT:
            raise _refusal(path, f"quaternions in {name} that are no rotations", "unit quaternions")
    if np.abs(arrays["times"] - timestep * np.arange(frames)).max() > _LATE:
        raise _refusal(path, "other times", f"0 s, {timestep:g} s and so on")
    return Trajectory(**arrays)


def check_metrics(path: Path, metrics: Any) -> None:
    """Raise InputError for what is not the metrics of a run."""
    good = (
        isinstance(metrics, dict)
        and isinstance(metrics.get("success"), bool)
        and _number(metrics.get("seconds"))
        and isinstance(metrics.get("windows"), list)
        and all(
            isinstance(window, dict)
            and all(_number(window.get(name)) for name in ("start", "end", "difficulty"))
            for window in metrics["windows"]
        )
    )
    if not good:
        raise _refusal(path, "other data", "metrics of a run")


def check_record(path: Path, record: Any, layout: str) -> None:
    """Raise InputError for what is not the record of a run of this layout."""
    if not isinstance(record, dict) or record.get("format") != layout:
        raise InputError(str(path), "another format", layout, "make the run anew with this version")
    identity = record.get("identity")
    if not isinstance(identity, dict) or not isinstance(identity.get("clip"), str):
        raise _refusal(path, "no identity", "what the run was made from")


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _refusal(path: Path, found: str, expected: str) -> InputError:
    return InputError(str(path), found, expected, "make the run anew")

"""What decides a result's bits: fingerprints of its inputs, and versions of what computed it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from physique.errors import InputError

_PACKAGES = ("cma", "llvmlite", "mujoco", "numba", "numpy", "physique", "scipy")


def versions() -> dict[str, str]:
    """Of Python, and of each package that decides the bits of a result."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {**{name: version(name) for name in _PACKAGES}, "python": python}


def digest(value: object, skip: tuple[str, ...] = ()) -> str:
    """SHA-256 of arrays, numbers, strings, and dataclasses and tuples of them.

    skip: fields of dataclasses that do not count.
    """
    state = hashlib.sha256()
    _feed(state, value, skip)
    return state.hexdigest()


def _feed(state: hashlib._Hash, value: object, skip: tuple[str, ...]) -> None:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            if field.name not in skip:
                state.update(field.name.encode())
                _feed(state, getattr(value, field.name), skip)
    elif isinstance(value, tuple | list):
        state.update(f"({len(value)}".encode())
        for item in value:
            _feed(state, item, skip)
    elif isinstance(value, np.ndarray):
        state.update(f"{value.dtype.str}{value.shape}".encode())
        state.update(np.ascontiguousarray(value).tobytes())
    else:
        state.update(repr(value).encode())


def fingerprint(identity: Mapping[str, Any]) -> str:
    """What tells pieces of one piece of work from those of another."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def require_same(place: Path, what: str, stored: object, wanted: Mapping[str, Any], remedy: str) -> None:
    """Raise InputError that names the first difference between work that is stored and the work
    that is asked for.

    what: that is, such as "a run".
    """
    if not isinstance(stored, dict):
        raise InputError(str(place), "other data", f"what {what} is", remedy)
    # Through JSON, so that both sides have JSON's types.
    theirs, mine = _flat(stored), _flat(json.loads(json.dumps(wanted)))
    # What the user chose explains more than the fingerprints that follow from it.
    for name in sorted(theirs.keys() | mine.keys(), key=lambda name: (name.endswith("sha256"), name)):
        if mine.get(name) != theirs.get(name):
            raise InputError(
                str(place),
                f"{what} with {name.replace('_', ' ')} {_short(theirs.get(name))}",
                f"{_short(mine.get(name))}, as asked for now",
                remedy,
            )


def _flat(value: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Mappings within mappings as one, under joined names."""
    out: dict[str, Any] = {}
    for name, item in value.items():
        out |= _flat(item, f"{prefix}{name} ") if isinstance(item, dict) else {prefix + name: item}
    return out


def _short(value: Any) -> str:
    text = str(value)
    return text[:12] if len(text) == 64 else text

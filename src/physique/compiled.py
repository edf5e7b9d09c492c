"""Loops that run as machine code and leave Python's lock to other threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """`function` by Numba, compiled at its first call and kept on disk for the next process.

    No fast-math: the same numbers give the same bits, and infinities stay what they are. Compiled
    functions fill their arguments: arrays that they return to Python are not safe where code comes
    from the disk (Numba 0.68: "'descr' is NULL").
    """
    return cast(F, numba.njit(nogil=True, cache=True, error_model="numpy")(function))

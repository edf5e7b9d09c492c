"""Loops that run as machine code and leave Python's lock to other threads."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import TypeVar, cast

import numba
from numba.core import event
from numba.core.dispatcher import Dispatcher

log = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """`function` by Numba, compiled at its first call and kept on disk for the next process.

    No fast-math: the same numbers give the same bits, and infinities stay what they are. Compiled
    functions fill their arguments: arrays that they return to Python are not safe where code comes
    from the disk (Numba 0.68: "'descr' is NULL").
    """
    try:
        return cast(F, numba.njit(nogil=True, cache=True, error_model="numpy")(function))
    except RuntimeError:  # "cannot cache function": neither beside the source nor at home
        _warn_of_no_cache()
        return cast(F, numba.njit(nogil=True, error_model="numpy")(function))


@cache
def _warn_of_no_cache() -> None:
    log.warning(
        "no folder can be written to keep compiled code in, so that every run compiles for half a minute; "
        "set NUMBA_CACHE_DIR to a folder that can"
    )


@contextmanager
def compiling(tell: Callable[[int, int], None]) -> Iterator[None]:
    """Call `tell(begun, total)` at each function that is compiled for want of its code on disk.

    begun: how many functions of physique were come to. total: how many are imported by now.
    """
    begun: set[str] = set()

    class Listener(event.Listener):
        def on_start(self, event: event.Event) -> None:
            begun.add(_name(event.data["dispatcher"]))
            names = _names()
            tell(len(begun & names), len(names))

        def on_end(self, event: event.Event) -> None:
            """What is inside a function is compiled within its time: only beginnings are in order."""

    with event.install_listener("numba:compile", Listener()):
        yield


def _name(dispatcher: Dispatcher) -> str:
    return f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"


def _names() -> set[str]:
    """The compiled functions of the modules of this package that are imported."""
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("physique.")]
    values = [value for module in modules for value in vars(module).values()]
    return {_name(value) for value in values if isinstance(value, Dispatcher)}

"""Settings of the whole process that several simulations want at once."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

import mujoco
from threadpoolctl import threadpool_limits


class ProcessSetting:
    """A context that sets something for the process as the first enters, and restores it as the last leaves.

    Contexts that overlap without being nested would else restore each other's setting.
    """

    def __init__(self, apply: Callable[[], Callable[[], object]]) -> None:
        """apply: sets it; what comes back restores it."""
        self._apply = apply
        self._lock = Lock()
        self._users = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._users == 0:
                self._restore = self._apply()
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                self._restore()


def silence() -> Callable[[], object]:
    """Turn MuJoCo's messages off; what comes back turns them on again."""
    before, during = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    during.logto_console = False
    during.logto_file = False
    mujoco.MjLogConfig.set(during)
    return lambda: mujoco.MjLogConfig.set(before)


_QUIET = ProcessSetting(silence)
#: BLAS threads under our own make small products many times slower.
ONE_BLAS_THREAD = ProcessSetting(lambda: threadpool_limits(1).restore_original_limits)


def quiet() -> ProcessSetting:
    """While this lasts, MuJoCo neither prints warnings nor writes MUJOCO_LOG.TXT.

    An optimiser tries controls that blow up by the hundred; it sees that in the roll-out's result.
    """
    return _QUIET

"""MuJoCo without its own messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco


@contextmanager
def quiet() -> Iterator[None]:
    """While this lasts, MuJoCo neither prints warnings nor writes MUJOCO_LOG.TXT.

    An optimiser tries controls that blow up by the hundred; it sees that in the roll-out's result.
    """
    before, during = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    during.logto_console = False
    during.logto_file = False
    mujoco.MjLogConfig.set(during)
    try:
        yield
    finally:
        mujoco.MjLogConfig.set(before)

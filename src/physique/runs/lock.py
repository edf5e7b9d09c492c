"""One process at a time writes into a run's folder."""

from __future__ import annotations

import logging
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from physique.errors import InputError, reason

log = logging.getLogger(__name__)

#: The lock, and who holds it. Both are hidden and no part of the run.
LOCK, HOLDER = ".lock", ".lock-holder"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """While this lasts, nobody else can lock the folder, which must exist.

    The system drops the lock of a process that ends, however it does. Raises InputError that names
    the other process where one holds it. Where the file system knows no locks, a warning says so.
    """
    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(
            str(folder),
            f"another process that writes into it ({_holder(folder)})",
            "none",
            "wait for its end or stop it, or choose another folder",
        ) from None
    except OSError as fault:
        log.warning("%s: cannot be locked (%s); let only one process write into it", folder, reason(fault))
        yield
        return
    holder = folder / HOLDER
    try:
        command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        with suppress(OSError):  # a full disk is told by what must be written
            holder.write_text(f"process {os.getpid()}: {command}", encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            holder.unlink(missing_ok=True)
        lock.release()


def _holder(folder: Path) -> str:
    try:
        return (folder / HOLDER).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return "it does not say which"

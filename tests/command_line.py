"""Commands as the tests call them."""

from __future__ import annotations

from physique.cli import main


def call(*arguments: object) -> int:
    """The exit code of a command, run in this process."""
    try:
        main([str(a) for a in arguments])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0

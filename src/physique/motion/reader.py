"""What a reader of motion files is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from physique.motion.clip import Clip


@dataclass(frozen=True)
class Reader:
    """One format of motion files.

    name: of the format, for messages. suffixes: in lower case, with the dot.
    recognises: whether a file is of this format, by its first bytes (and its path, where other
        files beside it belong to it).
    read: the clip in a file. Raises InputError for files that are damaged.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes, Path], bool]
    read: Callable[[Path], Clip]

"""The formats of motion files, and which of them a file has."""

from __future__ import annotations

import logging
from pathlib import Path

from physique.errors import InputError
from physique.motion import asfamc, bvh
from physique.motion.reader import Reader
from physique.motion.text import unreadable

#: A new format is one file that ends with its `Reader`, and its name here.
READERS: tuple[Reader, ...] = (bvh.READER, asfamc.READER)

_HEAD = 4096  # bytes, enough to recognise a format by

_log = logging.getLogger(__name__)


def formats() -> str:
    """The formats that can be read, for messages and help: "BVH (.bvh), ..."."""
    return ", ".join(f"{reader.name} ({', '.join(reader.suffixes)})" for reader in READERS)


def by_suffix(path: Path) -> Reader | None:
    """The reader of the path's suffix, or None."""
    return next((reader for reader in READERS if path.suffix.lower() in reader.suffixes), None)


def choose_reader(path: Path) -> Reader:
    """The reader of a file: the one that recognises its content, or else the one of its suffix.

    A content that contradicts the suffix is read for what it is, with a warning.
    Raises InputError, listing the formats, where no reader fits, or the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise unreadable(path, error, "a motion file") from error
    named = by_suffix(path)
    fitting = [reader for reader in READERS if reader.recognises(head, path)]
    if named is not None and (named in fitting or not fitting):
        return named
    if not fitting:
        raise InputError(
            str(path),
            f"a {path.suffix} file" if path.suffix else "a file of no known type",
            f"one of {formats()}",
            "convert it, or check that it is complete",
        )
    if named is not None:
        _log.warning("%s: the content is %s, whatever the suffix says; read as that", path, fitting[0].name)
    return fitting[0]

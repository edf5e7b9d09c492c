"""The collection of odd files from the wild, where it stands beside the repository."""

from __future__ import annotations

from pathlib import Path

import pytest

from damage import value_or_one_line
from physique.motion.read import read_motion
from physique.motion.readers import READERS

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
SUFFIXES = [suffix for reader in READERS for suffix in reader.suffixes]
FILES = sorted(path for path in CASES.rglob("*") if path.suffix.lower() in SUFFIXES)

#: What the line says of files that cannot be read; all others give a motion.
REFUSED = {
    "c01": "does not hang down",
    "c02": "does not hang down",
    "c04": "does not hang down",
    "c13": "points backwards",
    "c28": "second ROOT",
    "c34": "found '0.000000-0.000000'",
    "c35": "write 'Frames: 48'",
    "c37": "points instead of commas",
    "c41": "found 'EndSite'",
    "c44": "Frame Time: 0;",
    "c45": "Frame Time: 33",
    "c46": "JOINT outside ROOT",
    "c47": "'Nub' twice",
    "c49": "a single frame",
    "c51": "line 1",
    "c63": "does not hang down",
    "c68": "'Xscale'",
    "c71": "4.4 m",
    "c72": "44 m",
    "c78": "root position",
    "c79": "root axis 'ZYX'",
    "c84": "the bone's name",
    "c85": "0 values for length",
    "c88": "no values for 'root'",
    "c90": "2 values for axis",
}


@pytest.mark.skipif(not FILES, reason="needs the collection in ../shared/cases beside the repository")
def test_each_case_is_read_or_refused_in_one_line() -> None:
    """Which of the two, and in which words, may change for the better: then the table does too."""
    for path in FILES:
        messages: list[str] = []
        motion = value_or_one_line(lambda path=path: read_motion(path), messages)
        case = str(path.relative_to(CASES))[:3]
        assert (motion is None) == (case in REFUSED), path
        assert motion is not None or REFUSED[case] in messages[0], messages

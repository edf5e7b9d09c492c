"""Long tables in pieces: what is finished is stored at once, and not made again.

`Cells` keeps values, `kept_run` a run with its motion. Both hold only for the code and the versions
of packages that made them.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from physique.commands.inputs import BodyLike
from physique.commands.retarget import retarget
from physique.motion.clip import Motion
from physique.provenance import versions
from physique.runs.run import Run
from physique.store import prepare_folder, read_json, write_json

#: Rooms that show results and do not make them.
_SHOWING = {"cli", "experiments", "export", "live", "render", "report"}


@functools.cache
def makers() -> dict[str, str]:
    """What makes results: the hash of the code that does, and the versions of packages."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in _SHOWING:
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return {"code": digest.hexdigest()[:16], **versions()}


def mark() -> str:
    """The makers in eight letters, for names of files."""
    return hashlib.sha256(repr(makers()).encode()).hexdigest()[:8]


class Cells:
    """Named values in one JSON file, each with what it was made of.

    Raises InputError where the file is damaged or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._cells: dict[str, dict[str, Any]] = read_json(path) if path.is_file() else {}

    @property
    def values(self) -> dict[str, Any]:
        """All that is stored, whatever it was made of."""
        return {name: cell["value"] for name, cell in self._cells.items()}

    @property
    def codes(self) -> int:
        """How many versions of the code made what is stored."""
        return len({cell["inputs"]["code"] for cell in self._cells.values()})

    def has(self, name: str, **inputs: Any) -> bool:
        """Whether a value is stored that these inputs and this code made."""
        return name in self._cells and self._cells[name]["inputs"] == {**makers(), **inputs}

    def put(self, name: str, value: Any, **inputs: Any) -> Any:
        """Store a value, of JSON's types, as these inputs made it; the value comes back."""
        self._cells[name] = {"inputs": {**makers(), **inputs}, "value": value}
        prepare_folder(self._path.parent)
        write_json(self._path, self._cells)
        return value

    def make(self, name: str, work: Callable[[], Any], **inputs: Any) -> Any:
        """The stored value, or else what `work` returns, stored."""
        if self.has(name, **inputs):
            return self._cells[name]["value"]
        return self.put(name, work(), **inputs)


def kept_run(folder: Path, clip: str | Path | Motion, body: BodyLike, **options: Any) -> Run:
    """`retarget` into a folder of this name and the makers' mark: a run that is there is kept, one
    that was stopped goes on."""
    sys.stderr.write(f"{getattr(clip, 'name', clip)} on {body} {options or ''}\n")
    return retarget(clip, body, out=folder.with_name(f"{folder.name}-{mark()}"), resume=True, **options)

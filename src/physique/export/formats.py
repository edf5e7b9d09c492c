"""The formats that runs can be written in: a new one is a module with its writer, and a line here.

Writers are imported when they are called: the command line reads this table for its help, and what
a format needs concerns that format alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from physique.errors import InputError

if TYPE_CHECKING:
    from physique.runs.run import Run


@dataclass(frozen=True)
class Format:
    """A kind of file.

    suffixes: of its files; the first is its own. writer: "module:function"; it takes the path, the
    run, and by name what `options` says, and may leave no torso of a file. options: those that the
    format has, of source, capsules, rate and size. together: a file shows several runs, and the
    writer takes a sequence of them.
    """

    name: str
    suffixes: tuple[str, ...]
    writer: str
    options: tuple[str, ...]
    together: bool = False

    def owns(self, path: Path) -> bool:
        """Whether the path ends as files of this format do."""
        return path.suffix.lower() in self.suffixes

    def check(self, options: Mapping[str, object]) -> None:
        """Raise InputError for the first of these options that the format does not have."""
        for name in options:
            if name not in self.options:
                raise InputError(
                    f"option {name}", f"the format {self.name}", names(name), f"leave {name} out"
                )

    def write(self, path: Path, runs: Sequence[Run], options: Mapping[str, object]) -> Path:
        """Write the runs, only one where a file does not show several; `path` comes back."""
        resolve_name(self.writer)(path, runs if self.together else runs[0], **options)
        return path


_LOOK = ("source", "capsules")
FORMATS = (
    Format("glb", (".glb",), "physique.export.gltf:write_glb", _LOOK, together=True),
    Format("bvh", (".bvh",), "physique.export.bvh:write_run_bvh", ("source",)),
    Format("usd", (".usd", ".usdc", ".usda"), "physique.export.usd:write_usd", _LOOK, together=True),
    Format("amass", (".npz",), "physique.export.amass:write_amass", ("source",)),
    Format("mjcf", (".xml", ".mjcf"), "physique.export.mjcf:write_mjcf", ("source", "rate")),
    Format("mp4", (".mp4",), "physique.export.video:write_video", (*_LOOK, "rate", "size"), together=True),
    Format("csv", (".csv",), "physique.export.table:write_table", ("source",)),
)
#: Formats that other programs make of ours, and how.
_BY_OTHERS = {"fbx": "write a .glb, then `python tools/glb_to_fbx.py in.glb out.fbx` (needs the package bpy)"}


def find_format(name: str | None, path: Path) -> Format:
    """The format of this name; None takes the one that the suffix of `path` says.

    Raises InputError where there is none.
    """
    for each in FORMATS:
        if each.name == name or (name is None and each.owns(path)):
            return each
    found = repr(name) if name is not None else f"the suffix {path.suffix!r} of {path.name!r}"
    wanted = (path.suffix.removeprefix(".") if name is None else name).lower()
    remedy = _BY_OTHERS.get(wanted, "give one of these as --format")
    raise InputError("format", found, names(), remedy)


def names(option: str | None = None, *, together: bool = False) -> str:
    """All formats, or those that have an option, or that show several runs: "mjcf, mp4"."""
    found = (f for f in FORMATS if (option is None or option in f.options) and f.together >= together)
    return ", ".join(each.name for each in found)

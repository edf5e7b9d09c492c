"""Bodies from what a user says of a person, to look at and to store."""

from __future__ import annotations

import io
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from physique.body.bodyfile import save_body
from physique.body.capsule_body import CapsuleBody
from physique.body.describe import BodyFacts, describe_body
from physique.body.fit import Sex, make_body
from physique.body.mesh import BodyMesh
from physique.commands.inputs import find_body
from physique.commands.outputs import check_output
from physique.errors import InputError
from physique.render.picture import body_picture
from physique.store import prepare_folder, write_atomic


@dataclass(frozen=True)
class MadeBody:
    """A person's mesh, the capsules that stand for it, and what fitting them took, s."""

    mesh: BodyMesh
    capsules: CapsuleBody
    fit_seconds: float

    def facts(self) -> BodyFacts:
        """The body in a few numbers."""
        return describe_body(self.mesh, self.capsules, self.fit_seconds)


def choose_body(
    name: str | None = None, *, sex: Sex | None = None, height: float | None = None, mass: float | None = None
) -> MadeBody:
    """A ready body by name, a body file, or the body of this sex, stature (m) and mass (kg).

    What is left out of the three is a man's of 1.75 m and 75 kg. Raises InputError where the name
    is not known, a file is damaged, or no body is like that.
    """
    described: dict[str, Any] = {
        key: value for key, value in {"sex": sex, "height": height, "mass": mass}.items() if value is not None
    }
    if name is not None and described:
        raise InputError(
            f"body {name!r}",
            "a name and " + ", ".join(f"--{key}" for key in described),
            "one or the other",
            "leave out the name or the description",
        )
    wanted = make_body(**described) if name is None else name
    clock = time.perf_counter()
    skin, capsules = find_body(wanted)
    if skin is None:
        raise InputError(
            str(name),
            "capsules without a mesh",
            "a body file with a mesh",
            "write one with `physique body --out`",
        )
    return MadeBody(skin, capsules, time.perf_counter() - clock)


def write_body(path: Path, made: MadeBody) -> None:
    """Store a body as an npz file. Raises InputError where the file cannot be written, and for a run's."""
    check_output(path, (".npz",))
    prepare_folder(path.parent)
    save_body(path, made.mesh, made.capsules)


def picture_body(path: Path, made: MadeBody) -> None:
    """Draw skin and capsules into a PNG file. Raises InputError where it cannot be written."""
    check_output(path, (".png",))
    prepare_folder(path.parent)
    write_png(path, body_picture(made.mesh, made.capsules))


def write_png(path: Path, picture: Any) -> None:
    """Write a picture (h, w, 3) of bytes."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", optimize=True)
    write_atomic(path, buffer.getvalue())

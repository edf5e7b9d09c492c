"""What a run is made from: the body, the limits and the held object that options name."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physique.body.bodyfile import load_body
from physique.body.build import capsule_body
from physique.body.capsule_body import CapsuleBody
from physique.body.held import Hand, Held, parse_held
from physique.body.mesh import BodyMesh
from physique.body.named import PEOPLE, named_body
from physique.character.strength import torque_limits
from physique.errors import InputError, suggest
from physique.reference.target import TERMS, Weights

Array = NDArray[np.float64]

#: A person, by the name of a ready body, a body file, a mesh or a capsule body.
BodyLike = str | Path | BodyMesh | CapsuleBody
TorqueLimit = Literal["body"] | float

_STRONGEST = 10_000.0  # Nm, far beyond any joint of any body


def find_body(body: BodyLike) -> tuple[BodyMesh | None, CapsuleBody]:
    """The mesh and the capsules of a ready body's name, a body file, or a mesh.

    No mesh where capsules are given, or a body file has none.
    Raises InputError where there is none of that name, or the file is damaged.
    """
    if isinstance(body, CapsuleBody):
        return None, body
    if str(body) in PEOPLE:
        body = named_body(str(body))
    if isinstance(body, BodyMesh):
        return body, capsule_body(body)
    if isinstance(body, Path) or body.endswith(".npz") or Path(body).exists():
        return load_body(body)
    raise InputError(
        f"body {body!r}",
        "no such body or file",
        "a body file (.npz) or one of " + ", ".join(PEOPLE),
        suggest(str(body), PEOPLE, "correct the name, or make a file with `physique body --out`"),
    )


def find_limits(limit: TorqueLimit, body: CapsuleBody) -> Array:
    """Torque limits (50,), Nm: those of a person of this mass and stature, or one for all."""
    if limit == "body":
        return np.asarray(torque_limits(body.mass, body.height))
    number = isinstance(limit, int | float) and not isinstance(limit, bool)
    if not number or not math.isfinite(limit) or not 0 < limit <= _STRONGEST:
        raise InputError(
            "torque limit",
            f"{limit:g} Nm" if number else repr(limit),
            f"a positive number of Nm up to {_STRONGEST:g}, or `body`",
            "correct the value",
        )
    return np.full(50, float(limit))


def find_held(text: str | None, hand: Hand | None) -> Held | None:
    """What the hand holds, the right one if none is named; None for no text.

    Raises InputError for a hand without an object, and as `parse_held`.
    """
    if text is not None:
        return parse_held(text, hand or "right")
    if hand is not None:
        raise InputError(
            "hand", f"{hand} with nothing to hold", "an object too", "add --hold, or leave it out"
        )
    return None


def parse_weights(texts: Sequence[str], base: Weights) -> Weights:
    """The weights of E `base` with those that texts such as "com=30" change.

    Raises InputError for a name that is no term of E, one that comes twice, or no such number.
    """
    found: dict[str, float] = {}
    for text in texts:
        name, equals, number = (part.strip() for part in text.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not equals or name not in TERMS or math.isnan(value):
            raise InputError(
                f"weight {text!r}",
                "no such weight" if name not in TERMS else "no number",
                "NAME=NUMBER with a name of " + ", ".join(TERMS),
                "correct the text",
            )
        if name in found:
            raise InputError(f"weight {name}", "two values", "one", "leave one out")
        found[name] = value
    return dataclasses.replace(base, **found)  # type: ignore[arg-type]

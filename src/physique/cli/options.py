"""What options of several commands share: how they are read and how the help shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg
from tyro.constructors import PrimitiveConstructorSpec

from physique.cli import units


def left_out(metavar: str, what: str | None = None) -> object:
    """How an option is shown whose default is None: what happens then, if that is to be said."""
    return arg(metavar=metavar, help_behavior_hint=f"(default: {what})" if what else "(optional)")


def _measured(quantity: units.Quantity, metavar: str) -> PrimitiveConstructorSpec[float]:
    """How a number with a unit is read."""
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda texts: quantity.parse(texts[0]),
        is_instance=lambda value: isinstance(value, float),
        str_from_instance=lambda value: [str(value)],
    )


HEIGHT = _measured(units.HEIGHT, "HEIGHT")
MASS = _measured(units.MASS, "MASS")
SECONDS = _measured(units.SECONDS, "SECONDS")

Flag = Annotated[bool, arg(help_behavior_hint="")]
Runs = Annotated[Positional[tuple[Path, ...]], arg(metavar="RUN [RUN ...]", help_behavior_hint="(required)")]
Threads = Annotated[int | None, left_out("COUNT", "as many as the machine has, at most 8")]

"""Heights, masses and times as people write them: 1.63m, 178cm, 5ft10, 160lb, 500ms."""

from __future__ import annotations

import logging
import math
import re
from dataclasses import dataclass, field
from decimal import Decimal

from physique.errors import InputError

log = logging.getLogger(__name__)

_NUMBER = r"(\d+(?:\.\d*)?(?:e[-+]?\d{1,3})?|\.\d+)"
_LONGEST = 40  # characters of a number
_QUOTES = str.maketrans("’′”″", "''\"\"")


@dataclass(frozen=True)
class Quantity:
    """What can be measured, and the ways to write it.

    units: what one of each is in SI. below: of what unit is a second number, after each, e.g. the
    inches of 5ft10. bare: units of a number that stands alone, each with the least such number.
    """

    name: str
    forms: str
    units: dict[str, Decimal]
    below: dict[str, tuple[str, ...]] = field(default_factory=dict)
    bare: tuple[tuple[Decimal, str | None], ...] = ()

    def parse(self, text: str) -> float:
        """The value in SI. Raises InputError for what is none of the forms."""
        unit = "|".join(re.escape(name) for name in sorted(self.units, key=len, reverse=True))
        pattern = rf"{_NUMBER}\s*({unit})?\s*(?:{_NUMBER}\s*({unit})?)?"
        found = re.fullmatch(pattern, text.strip().lower().translate(_QUOTES))
        if found is None:
            raise self._refusal(text)
        first, name, second, smaller = found.groups()
        if any(
            number and (len(number) > _LONGEST or float(number) == math.inf) for number in (first, second)
        ):
            raise self._refusal(text)
        value = Decimal(first)
        if name is None:
            name = next((unit for least, unit in self.bare if value >= least), None)
            if name is None or second is not None:
                raise self._refusal(text)
            if name != self.bare[-1][1]:
                log.warning("%s %s: taken as %s %s", self.name, text, first, name)
        total = value * self.units[name]
        if second is not None:
            below = self.below.get(name, ())
            rest = Decimal(second) * self.units[smaller or below[0]] if below else Decimal(0)
            if not below or (smaller or below[0]) not in below or rest >= self.units[name]:
                raise self._refusal(text)
            total += rest
        return float(total)

    def _refusal(self, text: str) -> InputError:
        return InputError(self.name, repr(text), self.forms, "correct the value")


_FEET, _INCHES = ("ft", "feet", "foot", "'"), ("in", "inch", "inches", '"', "''")
_STONES, _POUNDS = ("st", "stone"), ("lb", "lbs", "pounds")

HEIGHT = Quantity(
    "height",
    "a height such as 1.63m, 178cm, 5ft10 or 70in",
    {"m": Decimal(1), "cm": Decimal("0.01"), "mm": Decimal("0.001")}
    | dict.fromkeys(_FEET, Decimal("0.3048"))
    | dict.fromkeys(_INCHES, Decimal("0.0254")),
    {"m": ("cm",)} | dict.fromkeys(_FEET, _INCHES),
    # No person is between 3 and 50 of anything; above that it is centimetres.
    ((Decimal(50), "cm"), (Decimal("3.000001"), None), (Decimal(0), "m")),
)
MASS = Quantity(
    "mass",
    "a mass such as 72kg, 160lb or 11st4",
    {"kg": Decimal(1)}
    | dict.fromkeys(_STONES, Decimal("6.35029318"))
    | dict.fromkeys(_POUNDS, Decimal("0.45359237")),
    dict.fromkeys(_STONES, _POUNDS),
    ((Decimal(0), "kg"),),
)
SECONDS = Quantity(
    "time",
    "a time such as 1.5, 1.5s or 500ms",
    {"s": Decimal(1), "ms": Decimal("0.001")},
    bare=((Decimal(0), "s"),),
)

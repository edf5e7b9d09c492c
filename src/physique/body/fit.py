"""From what one knows of a person, stature and mass, to a body shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from scipy.optimize import brentq

from physique.body.makehuman import AGES, DENSITY, Phenotype, body_mesh, stature_and_volume
from physique.body.mesh import BodyMesh
from physique.errors import InputError

Sex = Literal["male", "female", "neutral"]

SEXES: dict[str, float] = {"male": 0.0, "female": 1.0, "neutral": 0.5}
#: The heaviest bodies extrapolate MakeHuman's weight targets by a quarter of their range.
WEIGHT_LIMITS = (0.0, 1.25)


@dataclass(frozen=True)
class Range:
    """The statures or masses that can be reached, given everything else; m or kg."""

    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


def make_body(
    sex: Sex = "male",
    height: float = 1.75,
    mass: float = 75.0,
    age: float = 25.0,
    *,
    muscle: float | None = None,
    proportions: float = 0.5,
    name: str | None = None,
) -> BodyMesh:
    """The body of a person of this stature and mass, in the T-pose.

    sex: "male", "female" or "neutral" (half way).
    height: stature, m; hit within 0.1 mm.
    mass: kg at 985 kg/m3; hit within 10 g.
    age: years, 10 to 90.
    muscle: 0 (slack) to 1 (athletic). By default it falls from 0.5 to 0 as the mass departs from
        the middle of the range, which reaches the widest range of masses. It is not monotone in
        mass: see `docs/bodies.md`.
    proportions: 0 (ideal, as MakeHuman calls it) to 1 (uncommon).
    name: for listings and file names; made from the numbers by default.

    Raises InputError for values without meaning and for bodies out of reach; the message states the
    reachable range.
    """
    fixed = _checked_phenotype(sex, age, muscle, proportions)
    _check_number(
        "height",
        height,
        "metres",
        "stature between 0.5 and 3",
        0.5,
        3.0,
        "give the stature in metres, e.g. 1.75",
    )
    _check_number(
        "mass", mass, "kilograms", "mass between 5 and 500", 5.0, 500.0, "give the mass in kilograms, e.g. 75"
    )
    who = f"{sex}, {age:g} years" + ("" if muscle is None else f", muscle {muscle:g}")
    statures = reachable_height(sex, age, muscle=muscle, proportions=proportions)
    if height not in statures:
        raise InputError(
            "height",
            f"{height:g} m",
            f"{statures.low:.2f} to {statures.high:.2f} m for this body ({who})",
            "choose a stature in that range or another age",
        )
    masses = reachable_mass(sex, height, age, muscle=muscle, proportions=proportions)
    if mass not in masses:
        raise InputError(
            "mass",
            f"{mass:g} kg",
            f"{masses.low:.1f} to {masses.high:.1f} kg for this body ({who}, {height:g} m)",
            "choose a mass in that range" + ("" if muscle is None else ", or leave out muscle"),
        )
    along = _mass_path(fixed, muscle, height)
    low, high = _path_ends(muscle)
    s = brentq(lambda s: along(s)[1] - mass, low, high, xtol=1e-6)
    label = name if name is not None else f"{sex}_{100 * height:.0f}cm_{mass:.0f}kg"
    return body_mesh(along(s)[0], label)


def reachable_height(
    sex: Sex, age: float = 25.0, *, muscle: float | None = None, proportions: float = 0.5
) -> Range:
    """Statures, m, that `make_body` reaches with these choices, whatever the mass."""
    fixed = _checked_phenotype(sex, age, muscle, proportions)
    low, high = _path_ends(muscle)
    ends = [
        [stature_and_volume(_build(fixed, muscle, s, h))[0] for s in (low, 0.0, high)] for h in (0.0, 1.0)
    ]
    return Range(max(ends[0]), min(ends[1]))


def reachable_mass(
    sex: Sex, height: float, age: float = 25.0, *, muscle: float | None = None, proportions: float = 0.5
) -> Range:
    """Masses, kg, that `make_body` reaches at this stature with these choices."""
    along = _mass_path(_checked_phenotype(sex, age, muscle, proportions), muscle, height)
    low, high = _path_ends(muscle)
    return Range(along(low)[1], along(high)[1])


def _path_ends(muscle: float | None) -> tuple[float, float]:
    low, high = WEIGHT_LIMITS
    return 2.0 * low - 1.0, 2.0 * high - 1.0


def _build(fixed: Phenotype, muscle: float | None, s: float, height: float) -> Phenotype:
    """The phenotype at s on the way from the lightest (-1) to the heaviest body (1.5).

    MakeHuman's masses spread widely only where muscle is low, so muscle falls towards both ends.
    """
    tone = max(0.0, 0.5 - 0.5 * abs(s)) if muscle is None else muscle
    return Phenotype(
        sex=fixed.sex,
        age=fixed.age,
        muscle=tone,
        weight=0.5 + 0.5 * s,
        height=height,
        proportions=fixed.proportions,
    )


def _mass_path(
    fixed: Phenotype, muscle: float | None, stature: float
) -> Callable[[float], tuple[Phenotype, float]]:
    """s -> (phenotype of the wanted stature, its mass in kg)."""

    def along(s: float) -> tuple[Phenotype, float]:
        def excess(h: float) -> float:
            return stature_and_volume(_build(fixed, muscle, s, h))[0] - stature

        # The stature is all but linear in the height parameter: two or three steps.
        h = brentq(excess, -0.05, 1.05, xtol=1e-6)
        phenotype = _build(fixed, muscle, s, h)
        return phenotype, DENSITY * stature_and_volume(phenotype)[1]

    return along


def _checked_phenotype(sex: str, age: float, muscle: float | None, proportions: float) -> Phenotype:
    if sex not in SEXES:
        raise InputError("sex", repr(sex), "one of " + ", ".join(SEXES), "choose one of these")
    _check_number(
        "age", age, "years", f"{AGES[0]:g} to {AGES[-1]:g}", AGES[0], AGES[-1], "choose an age in that range"
    )
    for label, value in (("muscle", muscle), ("proportions", proportions)):
        if value is not None:
            _check_number(label, value, "", "0 to 1", 0.0, 1.0, "choose a value in that range")
    return Phenotype(sex=SEXES[sex], age=age, proportions=proportions)


def _check_number(
    place: str, value: float, unit: str, expected: str, low: float, high: float, remedy: str
) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not low <= value <= high:
        found = f"{value:g} {unit}" if number else repr(value)
        raise InputError(place, found, f"{expected} {unit}", remedy)

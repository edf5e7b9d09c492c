"""Ten ready bodies that span the people of the Dyna scans (section 5)."""

from __future__ import annotations

from dataclasses import dataclass

from physique.body.fit import Sex, make_body
from physique.body.mesh import BodyMesh
from physique.errors import InputError, suggest


@dataclass(frozen=True)
class Person:
    """A ready body: what it is made from. height: m. mass: kg. age: years."""

    description: str
    sex: Sex
    height: float
    mass: float
    age: float = 25.0
    muscle: float | None = None


#: The statures and masses of `thin` and `heavy` are those of the paper's Figure 1.
PEOPLE: dict[str, Person] = {
    "average": Person("man of middle height and mass", "male", 1.75, 75.0),
    "average_woman": Person("woman of middle height and mass", "female", 1.65, 62.0),
    "thin": Person(
        "lean man, of the stature and mass of the first body in the paper's Figure 1", "male", 1.69, 62.2
    ),
    "thin_woman": Person("slight woman", "female", 1.68, 48.0),
    "heavy": Person("very heavy man, the second body in the paper's Figure 1", "male", 1.80, 155.4),
    "heavy_woman": Person("heavy woman", "female", 1.66, 95.0),
    "tall": Person("tall, slim man", "male", 1.93, 84.0),
    "short_woman": Person("short woman of middle mass", "female", 1.52, 53.0),
    "athletic": Person("muscular man", "male", 1.80, 88.0, muscle=1.0),
    "stout": Person("stout older man", "male", 1.72, 98.0, age=60.0),
}


def named_body(name: str) -> BodyMesh:
    """The ready body of this name; InputError lists the names if there is none."""
    if name not in PEOPLE:
        remedy = suggest(name, PEOPLE, "choose one of these")
        raise InputError("body", repr(name), "one of " + ", ".join(PEOPLE), remedy)
    p = PEOPLE[name]
    return make_body(p.sex, p.height, p.mass, p.age, muscle=p.muscle, name=name)

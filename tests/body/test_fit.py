import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique.body.fit import make_body, reachable_height, reachable_mass
from physique.body.named import PEOPLE, named_body
from physique.errors import InputError


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    st.sampled_from(["male", "female", "neutral"]),
    st.floats(0.05, 0.95),
    st.floats(0.0, 1.0),
    st.floats(10.0, 90.0),
)
def test_hits_stature_and_mass(sex: str, tall: float, heavy: float, age: float) -> None:
    heights = reachable_height(sex, age)  # type: ignore[arg-type]
    height = heights.low + tall * (heights.high - heights.low)
    masses = reachable_mass(sex, height, age)  # type: ignore[arg-type]
    mass = masses.low + heavy * (masses.high - masses.low)
    body = make_body(sex, height, mass, age)  # type: ignore[arg-type]
    assert body.height == pytest.approx(height, abs=1e-4)
    assert body.mass == pytest.approx(mass, abs=0.01)


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("muscle", [None, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("age", [18.0, 25.0, 90.0])
def test_mass_rises_along_the_path(sex: str, muscle: float | None, age: float) -> None:
    """What makes the reachable range an interval and its inside solvable."""
    from physique.body.fit import _build, _checked_phenotype, _path_ends
    from physique.body.makehuman import stature_and_volume

    fixed = _checked_phenotype(sex, age, muscle, 0.5)
    s = np.linspace(*_path_ends(muscle), 26)
    volumes = [stature_and_volume(_build(fixed, muscle, x, 0.4))[1] for x in s]
    assert (np.diff(volumes) > 0.0).all()


@pytest.mark.parametrize("name", PEOPLE)
def test_named_bodies(name: str) -> None:
    body = named_body(name)
    assert body.name == name
    assert body.height == pytest.approx(PEOPLE[name].height, abs=1e-4)
    assert body.mass == pytest.approx(PEOPLE[name].mass, abs=0.01)


def test_the_papers_extremes_are_there() -> None:
    assert (PEOPLE["thin"].height, PEOPLE["thin"].mass) == (1.69, 62.2)
    assert (PEOPLE["heavy"].height, PEOPLE["heavy"].mass) == (1.80, 155.4)
    assert len(PEOPLE) == 10
    assert sum(p.sex == "female" for p in PEOPLE.values()) >= 4


def test_same_wishes_same_body() -> None:
    a, b = make_body("female", 1.7, 70.0), make_body("female", 1.7, 70.0)
    assert np.array_equal(a.vertices, b.vertices)


def test_muscle_tells_bodies_of_one_mass_apart() -> None:
    slack, fit = make_body(muscle=0.0), make_body(muscle=1.0)
    assert np.linalg.norm(slack.vertices - fit.vertices, axis=1).max() > 0.02


@pytest.mark.parametrize(
    ("wish", "text"),
    [
        ({"height": 180.0}, "height: found 180 metres; expected stature between 0.5 and 3 metres"),
        ({"mass": -5.0}, "mass: found -5 kilograms"),
        ({"mass": float("nan")}, "mass: found nan kilograms"),
        ({"height": float("inf")}, "height: found inf metres"),
        ({"height": "tall"}, "height: found 'tall'"),
        ({"mass": True}, "mass: found True"),
        ({"age": 5.0}, "age: found 5 years; expected 10 to 90 years"),
        ({"sex": "robot"}, "sex: found 'robot'; expected one of male, female, neutral"),
        ({"muscle": 1.5}, "muscle: found 1.5"),
        ({"proportions": -1.0}, "proportions: found -1"),
        ({"height": 2.9}, "height: found 2.9 m; expected 1.37 to 2.46 m for this body"),
        ({"mass": 200.0}, "mass: found 200 kg; expected 45.1 to 156.0 kg for this body"),
        ({"mass": 30.0}, "45.1 to 156.0 kg"),
        ({"mass": 90.0, "muscle": 0.5}, "or leave out muscle"),
    ],
)
def test_what_cannot_be_is_refused(wish: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match="expected") as caught:
        make_body(**wish)  # type: ignore[arg-type]
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_ends_of_the_stated_range_are_reachable() -> None:
    masses = reachable_mass("female", 1.6, 40.0)
    for mass in (masses.low, masses.high):
        assert make_body("female", 1.6, mass, 40.0).mass == pytest.approx(mass, abs=0.01)
    heights = reachable_height("male")
    for height in (heights.low, heights.high):
        middle = reachable_mass("male", height)
        body = make_body("male", height, 0.5 * (middle.low + middle.high))
        assert body.height == pytest.approx(height, abs=1e-4)


def test_unknown_name_lists_the_names() -> None:
    with pytest.raises(InputError, match="average_woman, thin"):
        named_body("giant")

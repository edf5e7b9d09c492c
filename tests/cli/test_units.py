"""Heights, masses and times as people write them."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.cli.units import HEIGHT, MASS, SECONDS, Quantity
from physique.errors import InputError

THOUSANDTHS = st.integers(1, 3000).map(lambda number: Decimal(number) / 1000)


@given(THOUSANDTHS)
def test_a_height_comes_back_from_each_metric_form(metres: Decimal) -> None:
    wanted = float(metres)
    assert HEIGHT.parse(f"{metres}") == wanted
    assert HEIGHT.parse(f"{metres}m") == wanted
    assert HEIGHT.parse(f" {metres} M ") == wanted
    assert HEIGHT.parse(f"{1000 * metres}mm") == wanted
    assert HEIGHT.parse(f"{100 * metres} cm") == wanted


@given(st.integers(0, 8), st.integers(0, 11))
def test_feet_and_inches_come_back_from_each_form(feet: int, inches: int) -> None:
    wanted = pytest.approx(0.3048 * feet + 0.0254 * inches, abs=1e-12)
    for text in ("{}ft{}", "{}ft{}in", "{} ft {} in", "{}'{}\"", "{}'{}", "{}′{}″", "{}’{}”", "{}'{}''"):
        assert HEIGHT.parse(text.format(feet, inches)) == wanted
    assert HEIGHT.parse(f"{12 * feet + inches}in") == wanted


@given(THOUSANDTHS)
def test_a_mass_comes_back(kilos: Decimal) -> None:
    assert MASS.parse(f"{kilos}kg") == MASS.parse(f"{kilos}") == float(kilos)
    assert MASS.parse(f"{kilos} lb") == pytest.approx(0.45359237 * float(kilos))


@given(THOUSANDTHS)
def test_a_time_comes_back(seconds: Decimal) -> None:
    assert SECONDS.parse(f"{seconds}s") == SECONDS.parse(f"{seconds}") == float(seconds)
    assert SECONDS.parse(f"{1000 * seconds}ms") == float(seconds)


@given(st.floats(0, 1e9))
def test_any_float_comes_back_as_python_writes_it(seconds: float) -> None:
    assert SECONDS.parse(repr(seconds)) == seconds


@pytest.mark.parametrize(("text", "metres"), [("163cm", 1.63), ("178", 1.78), ("1m63", 1.63), ("3", 3.0)])
def test_heights(text: str, metres: float) -> None:
    assert HEIGHT.parse(text) == metres


def test_stones_and_pounds() -> None:
    assert MASS.parse("11st4") == MASS.parse("11 st 4 lb") == pytest.approx(158 * 0.45359237)


def test_a_guessed_unit_is_told(caplog: pytest.LogCaptureFixture) -> None:
    HEIGHT.parse("1.78")
    assert caplog.messages == []
    HEIGHT.parse("178")
    assert caplog.messages == ["height 178: taken as 178 cm"]


@pytest.mark.parametrize(
    ("quantity", "text"),
    [
        *(
            (HEIGHT, text)
            for text in ("", "tall", "nan", "-1.8", "3.01", "49", "5ft12", "1.8kg", "1 78", "70in2")
        ),
        *((HEIGHT, text) for text in ("5ft10cm", "1.6.3m", "1,63m", "1.78 m m", "ft", "5in10")),
        *((MASS, text) for text in ("heavy", "inf", "-5", "70m", "11st14", "70 kilo", "70kg5", "70 5")),
        *((SECONDS, text) for text in ("-1", "2min", "1:30", "1s500", "soon")),
    ],
)
def test_what_is_no_measure_is_refused_with_the_forms(quantity: Quantity, text: str) -> None:
    with pytest.raises(InputError) as fault:
        quantity.parse(text)
    assert repr(text) in str(fault.value)
    assert quantity.forms in str(fault.value)

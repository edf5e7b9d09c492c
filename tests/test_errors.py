"""The exception for bad input, and the remedy that suggests a name."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.errors import InputError, suggest

NAMES = ("walk", "punch", "average_woman")


@given(st.sampled_from(NAMES), st.data())
def test_one_slip_of_the_finger_still_finds_the_name(name: str, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(name) - 1))
    typed = name[:at] + data.draw(st.sampled_from(["", "q", name[at] * 2])) + name[at + 1 :]
    assert suggest(typed, NAMES, "correct the name") == f"did you mean {name!r}?"


def test_dashes_are_no_likeness() -> None:
    options = ("--json", "--height")
    assert suggest("--heigth", options, "see the help") == "did you mean '--height'?"
    assert suggest("--version", options, "see the help") == "see the help"


@pytest.mark.parametrize("typed", ["", "zumba", "x.bvh"])
def test_what_is_near_nothing_gets_the_other_remedy(typed: str) -> None:
    assert suggest(typed, NAMES, "correct the name") == "correct the name"


words = st.text(max_size=30)


@given(words, words, words, words)
def test_it_is_one_line_and_goes_from_process_to_process(a: str, b: str, c: str, d: str) -> None:
    fault = InputError(a, b, c, d)
    again = pickle.loads(pickle.dumps(fault))
    assert type(again) is InputError
    assert vars(again) == vars(fault)
    assert str(again) == str(fault)
    assert len(str(fault).splitlines()) == 1

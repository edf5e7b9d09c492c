"""The exception for bad input."""

from __future__ import annotations

import pickle

from hypothesis import given
from hypothesis import strategies as st

from physique.errors import InputError

words = st.text(max_size=30)


@given(words, words, words, words)
def test_it_is_one_line_and_goes_from_process_to_process(a: str, b: str, c: str, d: str) -> None:
    fault = InputError(a, b, c, d)
    again = pickle.loads(pickle.dumps(fault))
    assert type(again) is InputError
    assert vars(again) == vars(fault)
    assert str(again) == str(fault)
    assert len(str(fault).splitlines()) == 1

"""Fingerprints and versions."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.errors import InputError
from physique.provenance import digest, fingerprint, require_same, versions

PLACE = Path("run.json")
values = st.none() | st.booleans() | st.integers() | st.text(max_size=5)
identities = st.dictionaries(st.sampled_from("abcd"), values | st.dictionaries(st.sampled_from("xy"), values))


def test_versions_are_of_all_that_decides_bits() -> None:
    assert versions().keys() == {
        *("cma", "llvmlite", "mujoco", "numba", "numpy", "physique", "python", "scipy")
    }
    assert versions()["numba"] == version("numba")


@given(identities)
def test_the_same_is_the_same(one: dict[str, Any]) -> None:
    require_same(PLACE, "a run", dict(reversed(one.items())), one, "try")
    assert fingerprint(one) == fingerprint(dict(reversed(one.items())))


@given(identities, st.sampled_from("abcd"))
def test_a_difference_is_named(one: dict[str, Any], name: str) -> None:
    with pytest.raises(InputError, match=rf"run\.json: found a run with {name}\b"):
        require_same(PLACE, "a run", {**one, name: "here"}, {**one, name: "there"}, "try")
    with pytest.raises(InputError, match=rf"a run with {name} y 1; expected 2"):
        require_same(PLACE, "a run", {**one, name: {"y": 1}}, {**one, name: {"y": 2}}, "try")


@pytest.mark.parametrize("stored", [None, [], "text", 3])
def test_what_is_no_identity_is_refused(stored: object) -> None:
    with pytest.raises(InputError, match="found other data"):
        require_same(PLACE, "a run", stored, {}, "try")


def test_digests_are_of_values_types_and_shapes() -> None:
    array = np.arange(6.0)
    told = [array, array.reshape(2, 3), array.astype(np.float32), array + 1, (array,), "0", 0, 0.0, None]
    assert len({digest(value) for value in told}) == len(told)
    assert digest(array) == digest(array.copy())

"""The field's usual rule for capsules, which ours is compared with."""

from __future__ import annotations

import pytest

from hull import hull_capsules
from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.body.surface_error import surface_error


@pytest.mark.parametrize("name", ["average", "heavy_woman"])
def test_ours_are_much_nearer_to_the_skin(name: str) -> None:
    mesh = named_body(name)
    ours, usual = (surface_error(mesh, parts) for parts in (capsule_body(mesh).parts, hull_capsules(mesh)))
    assert ours.mean_cm < 0.6 * usual.mean_cm
    assert usual.mean_cm < 5.0

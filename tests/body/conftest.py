from collections.abc import Callable
from functools import cache

import pytest

from physique.body.build import capsule_body
from physique.body.capsule_body import CapsuleBody
from physique.body.mesh import BodyMesh
from physique.body.named import named_body


@pytest.fixture(scope="session")
def person() -> Callable[[str], tuple[BodyMesh, CapsuleBody]]:
    """Named bodies and their capsules, each made once a session."""

    @cache
    def make(name: str) -> tuple[BodyMesh, CapsuleBody]:
        mesh = named_body(name)
        return mesh, capsule_body(mesh)

    return make

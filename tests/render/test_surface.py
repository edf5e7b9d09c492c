"""Shapes as meshes: closed, of the right volume, where the body has them."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from physique import skeleton
from physique.body.capsule_body import Part
from physique.body.primitives import Primitive, signed_distance
from physique.character.held import HeldGeom
from physique.errors import InputError
from physique.render.skin import skin_vertices
from physique.render.surface import capsule_surface, surface
from physique.runs.run import Run

EXACT = {
    "capsule": lambda s: np.pi * s[0] ** 2 * (2 * s[1] + 4 / 3 * s[0]),
    "box": lambda s: 8 * s[0] * s[1] * s[2],
    "ellipsoid": lambda s: 4 / 3 * np.pi * s[0] * s[1] * s[2],
}


def test_every_shape_has_its_volume_and_place(run: Run) -> None:
    made = capsule_surface(run.body)
    owner = made.weights.argmax(axis=1)
    assert set(np.unique(made.weights)) == {0.0, 1.0}
    of_face = owner[made.faces[:, 0]]
    for index, part in enumerate(run.body.parts):
        faces = made.faces[of_face == index]
        on_it = made.vertices[owner == index]
        assert np.abs(signed_distance(part, on_it)).max() < 1e-9, part.name
        a, b, c = (made.vertices[faces[:, k]] - part.center for k in range(3))
        tetrahedra = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
        exact = EXACT[part.shape](part.size)
        tolerance = 1e-9 if part.shape == "box" else 0.12  # ten flat sides lie inside the round
        assert tetrahedra.sum() == pytest.approx(exact, rel=tolerance), part.name
        assert tetrahedra.min() > -1e-15  # every face looks away from the middle
        middle = (tetrahedra[:, None] * (a + b + c) / 4).sum(0) / tetrahedra.sum()
        assert np.abs(middle).max() < 1e-3


def test_left_and_right_are_told_apart(run: Run) -> None:
    made = capsule_surface(run.body)
    owner = made.weights.argmax(axis=1)
    of = {p.name: made.colours[owner == i][0] for i, p in enumerate(run.body.parts)}
    assert np.array_equal(of["left_knee"], of["left_wrist"])
    assert not np.array_equal(of["left_knee"], of["right_knee"])
    assert not np.array_equal(of["left_knee"], of["spine1"])


def test_a_ball_is_a_capsule_without_length(run: Run) -> None:
    ball = Part(
        "head", "capsule", np.array([0.1, 0.0, 0.0]), np.zeros(3), np.eye(3), 1.0, np.zeros(3), np.eye(3)
    )
    made = capsule_surface(replace(run.body, parts=(ball,)))
    assert np.linalg.norm(made.vertices, axis=1) == pytest.approx(0.1)


def test_the_skin_is_asked_for_and_may_lack(run: Run) -> None:
    assert len(surface(run).vertices) == 13348
    bare = replace(run, mesh=None)
    with pytest.raises(InputError, match="capsules without a skin"):
        surface(bare)
    assert len(surface(bare, capsules=True).faces) > 1000


@pytest.mark.parametrize("capsules", [False, True])
def test_a_stick_goes_with_the_hand_that_holds_it(run: Run, armed_run: Run, capsules: bool) -> None:
    made, empty = surface(armed_run, capsules=capsules), surface(run, capsules=capsules)
    count = len(empty.vertices)
    assert np.array_equal(made.vertices[:count], empty.vertices)
    stick = made.vertices[count:]
    assert (made.weights[count:, skeleton.INDEX["right_wrist"]] == 1.0).all()
    assert np.ptp(stick, axis=0) == pytest.approx([1.0, 0.03, 0.03], abs=1e-3)  # 1 m, forward
    assert not (made.colours[count:] == made.colours[0]).all()
    # It is where MuJoCo has it.
    (geom,) = armed_run.held()
    character, frame = armed_run.character(), 31
    data = mujoco.MjData(character.model)
    data.qpos[:] = armed_run.trajectory.q[frame]
    mujoco.mj_kinematics(character.model, data)
    seen = skin_vertices(made, armed_run.trajectory.q[frame : frame + 1])[0][count:]
    local = (seen - data.geom_xpos[geom.geom]) @ data.geom_xmat[geom.geom].reshape(3, 3)
    assert np.abs(signed_distance(held_solid(geom), local)).max() < 1e-5


def held_solid(geom: HeldGeom) -> Primitive:
    return Primitive(geom.name, geom.shape, geom.size, np.zeros(3), np.eye(3))

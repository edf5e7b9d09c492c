"""Held objects: what a text means, what is refused, where the object lies in the hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique import skeleton
from physique.body.build import capsule_body
from physique.body.capsule_body import CapsuleBody
from physique.body.held import DEFAULT_SIZE, MASSES, SIZES, Held, held_parts, parse_held
from physique.body.named import named_body
from physique.errors import InputError

HANDS = ("right", "left", "both")


@pytest.fixture(scope="module")
def body() -> CapsuleBody:
    return capsule_body(named_body("average"))


@st.composite
def objects(draw: st.DrawFn) -> Held:
    shape = draw(st.sampled_from(("stick", "block")))
    return Held(shape, draw(st.floats(*MASSES)), draw(st.floats(*SIZES[shape])), draw(st.sampled_from(HANDS)))


@settings(deadline=None)
@given(objects())
def test_its_text_is_read_as_the_same_object(held: Held) -> None:
    assert parse_held(str(held), held.hand) == held


@pytest.mark.parametrize(
    ("text", "shape", "mass", "size"),
    [
        ("stick:2kg", "stick", 2.0, DEFAULT_SIZE["stick"]),
        ("stick:2.0kg:1.2m", "stick", 2.0, 1.2),
        (" block:.5kg ", "block", 0.5, DEFAULT_SIZE["block"]),
        ("block:5e0kg:0.3m", "block", 5.0, 0.3),
    ],
)
def test_texts(text: str, shape: str, mass: float, size: float) -> None:
    assert parse_held(text) == Held(shape, mass, size, "right")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "stick:2kg"),
        ("stick", "stick:2kg"),
        ("stick:2", "2 without a unit; expected 2kg"),
        ("stick:2lb", "found 2 lb; expected 2kg"),
        ("stick:2kg:1", "1 without a unit; expected 1m"),
        ("stick:2kg:120cm", "found 120 cm; expected 120m"),
        ("sword:2kg", "'sword'; expected stick or block"),
        ("stick:-2kg", "mass of the held stick: found -2 kg"),
        ("stick:0kg", "found 0 kg"),
        ("stick:1e9kg", "found 1e\\+09 kg; expected 0.001 to 100 kg"),
        ("stick:1e999kg", "found inf kg"),
        ("stick:nankg", "stick:2kg"),
        ("stick:2kg:9m", "length of the held stick: found 9 m"),
        ("block:2kg:0m", "edge of the held block: found 0 m"),
        ("stick:2kg:1m:1m", "stick:2kg"),
        ("stick:2kg\nblock:1kg", "stick:2kg"),
    ],
)
def test_other_texts_are_refused_in_one_line(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as fault:
        parse_held(text)
    assert "\n" not in str(fault.value)


@settings(deadline=None)
@given(st.text(alphabet="stickblo:kgm.0123456789-+e ", max_size=20))
def test_any_text_is_an_object_or_an_input_error(text: str) -> None:
    try:
        held = parse_held(text)
    except InputError:
        return
    assert MASSES[0] <= held.mass <= MASSES[1]


def test_a_wrong_hand_is_refused() -> None:
    with pytest.raises(InputError, match="hand: found 'foot'; expected right or left or both"):
        Held("stick", 1.0, 1.0, "foot")  # type: ignore[arg-type]


@settings(deadline=None)
@given(held=objects())
def test_it_lies_at_the_hand_that_holds_it(held: Held, body: CapsuleBody) -> None:
    parts = held_parts(held, body)
    assert tuple(parts) == held.hands
    for joint, part in parts.items():
        hand = body.parts[skeleton.INDEX[joint]]
        np.testing.assert_array_equal(part.com, part.center)
        gap = part.center - hand.center
        if held.shape == "stick":
            # Across the palm, which faces down: forward, under the middle of the hand.
            np.testing.assert_allclose(np.abs(part.R_world_from_part[:, 2]), [1, 0, 0])
            assert gap[0] == gap[1] == 0
            assert -0.06 < gap[2] < -0.02
            assert 2 * (part.size[0] + part.size[1]) == pytest.approx(held.size)
        else:
            # Its near face in the middle of the hand.
            outward = 1 if joint == "left_wrist" else -1
            np.testing.assert_allclose(gap, [0, outward * held.size / 2, 0], atol=1e-12)


def test_both_hands_hold_mirror_images(body: CapsuleBody) -> None:
    for text in ("stick:2kg", "block:5kg"):
        left, right = held_parts(parse_held(text, "both"), body).values()
        np.testing.assert_allclose(left.center, right.center * [1, -1, 1], atol=1e-9)
        np.testing.assert_allclose(left.inertia, right.inertia, atol=1e-15)

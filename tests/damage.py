"""Files damaged in every way that a property can draw, and what reading them may end in."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from hypothesis import settings
from hypothesis import strategies as st

from physique.errors import InputError

Value = TypeVar("Value")

ODD = (
    "",
    "nan",
    "-inf",
    "1e999",
    "1e308",
    "-1",
    "0",
    "1e-300",
    "9" * 5000,
    "²",
    "٣",
    "text",
    "{",
    "}",
    ":",
    "#",
    '"',
    "[",
    "]",
    "=",
    "\0",
    "\x85",
    "\ufffd" * 100,
    "\n",
    "a\nb",
)

#: The same examples on every machine and every day.
fixed = settings(derandomize=True, deadline=None, database=None, max_examples=50)


@st.composite
def damaged(draw: st.DrawFn, text: str) -> bytes:
    """`text` cut off anywhere, or with one of its words replaced, deleted, doubled or swapped."""
    if draw(st.integers(0, 3)) == 0:
        data = text.encode()
        return data[: draw(st.integers(0, len(data) - 1))]
    words = [match.span() for match in re.finditer(r"\w[\w.+-]*|\S|\n", text)]
    start, stop = draw(st.sampled_from(words))
    word = text[start:stop]
    other = slice(*draw(st.sampled_from(words)))
    new = draw(st.sampled_from((*ODD, f"{word} {word}", f"{word}\n{word}", f"-{word}", text[other])))
    return (text[:start] + new + text[stop:]).encode()


def value_or_one_line(read: Callable[[], Value], messages: list[str] | None = None) -> Value | None:
    """What `read` returns, or None where it refuses in one line of a size to be read.

    The line is added to messages.
    """
    try:
        return read()
    except InputError as error:
        text = str(error)
    assert text.isprintable(), ascii(text)
    assert len(text) < 5000
    if messages is not None:
        messages.append(text)
    return None

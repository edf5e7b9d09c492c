"""The colours of people: one palette for videos, files, reports and the live page.

All are sRGB, "#rrggbb".
"""

from __future__ import annotations

from collections.abc import Iterable

#: Of bodies that are shown together, and of their curves. Calm as skins, dark enough for lines on
#: white, and light enough for lines on black; the first five differ with any colour vision.
BODIES = ("#c69a7b", "#4a7fb8", "#9c4a3c", "#6aa897", "#b79ad6", "#5d6630")
#: Of the motion that the body should follow, which is seen through.
SOURCE, SOURCE_OPACITY = "#a9afb8", 0.4
#: Of shapes: of the middle of the body, of its left, of its right; as the character's model has.
SIDES = ("#b89985", "#598cbf", "#cc7361")


def body(index: int) -> str:
    """The colour of run number `index`."""
    return BODIES[index % len(BODIES)]


def rgb_bytes(colour: str) -> tuple[int, int, int]:
    """Red, green, blue of a colour, 0 to 255."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green, blue of a colour, 0 to 1."""
    red, green, blue = (value / 255 for value in rgb_bytes(colour))
    return red, green, blue


def of_rgb(values: Iterable[float]) -> str:
    """The colour of red, green, blue, 0 to 1."""
    return "#" + "".join(f"{round(255 * value):02x}" for value in values)


def linear_rgb(colour: str) -> list[float]:
    """Linear red, green, blue of a colour, 0 to 1 (IEC 61966-2-1)."""
    return [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in rgb(colour)]

"""The light that all pictures share: a sun with a sky, over a chequered floor that fades away.

Colours are stored ones, squares of which are light (a gamma of 2); light is given as it adds up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from physique.render.camera import Camera

Array = NDArray[np.float64]

TILE = 0.5  # m, side of the floor's squares
FOG = (7.0, 30.0)  # m, where the floor begins and ends to fade into the sky
SKY_TOP, SKY_LOW = np.array([0.70, 0.78, 0.87]), np.array([0.93, 0.94, 0.95])
SKY_BAND = 0.45  # sine of the height at which the sky has its upper colour
FLOOR = np.array([[0.92, 0.92, 0.91], [0.80, 0.81, 0.83]])
SUN = np.array([0.71, 0.66, 0.60])
SKY_LIGHT, GROUND_LIGHT = np.array([0.46, 0.49, 0.54]), np.array([0.22, 0.21, 0.20])
#: A weak light from the camera shows the shapes that are in the shade.
FILL = 0.12


def sun_of(camera: Camera) -> Array:
    """Unit direction (3,) towards a sun that shines from the upper left of the camera."""
    right, _, forward = camera.axes()
    ahead = np.array([forward[0], forward[1], 0.0])
    sun = -0.55 * right - 0.55 * ahead / np.linalg.norm(ahead) + np.array([0.0, 0.0, 1.05])
    return sun / np.linalg.norm(sun)

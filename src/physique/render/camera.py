"""Where a picture is taken from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera at `eye` that looks at `target`; the picture's up is the world's z.

    eye, target: (3,) m, world. fov: angle of view from top to bottom, degrees.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 35.0

    @classmethod
    def look_at(
        cls,
        target: ArrayLike,
        *,
        distance: float = 4.0,
        azimuth: float = 60.0,
        elevation: float = 10.0,
        fov: float = 35.0,
    ) -> Camera:
        """A camera `distance` m from `target` (3,).

        azimuth: degrees from +x towards +y in which the camera stands as seen from the target; 0
            sees the front of a person in the rest pose, 90 the left side, 180 the back.
        elevation: degrees above the horizontal, below 90.
        """
        a, e = np.radians([azimuth, elevation])
        away = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        at = np.asarray(target, dtype=float)
        return cls(_triple(at + distance * away), _triple(at), fov)

    def follow(self, point: ArrayLike) -> Camera:
        """The same view, moved over the ground so as to look at the x and y of `point` (>=2,)."""
        x, y = np.asarray(point, dtype=float)[:2] - np.array(self.target[:2])
        shift = np.array([x, y, 0.0])
        return replace(self, eye=_triple(self.eye + shift), target=_triple(self.target + shift))

    def holding(self, points: ArrayLike, size: tuple[int, int], margin: float = 1.12) -> Camera:
        """The camera of the same direction over the origin, as near as it sees all points (n, 3).

        size: (w, h) of the picture, pixels. margin: how much more than that it sees.
        """
        at = np.asarray(points, dtype=float)
        target = np.array([0.0, 0.0, 0.5 * (at[:, 2].min() + at[:, 2].max())])
        axes = self.axes()
        right, up, depth = ((at - target) @ axes.T).T
        tangent = np.tan(np.radians(self.fov) / 2.0)
        across = np.maximum(np.abs(right) * size[1] / size[0], np.abs(up)) / tangent
        eye = target - margin * float(np.max(across - depth)) * axes[2]
        return Camera(_triple(eye), _triple(target), self.fov)

    def axes(self) -> Array:
        """(3, 3): the directions right, up and forward of the picture, as rows, in the world."""
        forward = np.subtract(self.target, self.eye)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    def project(self, points: ArrayLike, size: tuple[int, int]) -> Array:
        """Where points (..., 3) before the camera are seen in a picture of `size` (w, h).

        Pixels (..., 2), (column, row), from the upper left corner of the picture; the middle of the
        first pixel is (0.5, 0.5).
        """
        width, height = size
        right, up, depth = np.moveaxis((np.asarray(points) - self.eye) @ self.axes().T, -1, 0)
        scale = height / (2.0 * np.tan(np.radians(self.fov) / 2.0))
        return np.stack([width / 2.0 + right / depth * scale, height / 2.0 - up / depth * scale], axis=-1)


def _triple(v: Array) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])

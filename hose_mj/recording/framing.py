"""Where a scene is looked at from: eye, grid, legend, and how thick its lines are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_mj.recording.episode import Array, Scene

_HALF_VIEW = float(np.tan(np.radians(27.5)))
"""The viewer's vertical field of view is 55 degrees."""
_ASPECT = 1.4
"""Width over height that a view is assumed to have."""
_THINNER = 0.55
_FLAT = 1e-2
"""A scene is planar if it is this much thinner than it is large."""


@dataclass(frozen=True, eq=False)
class Framing:
    """A view of a scene, in world coordinates (m).

    Attributes:
        eye, target, up: the camera, (3,) each.
        size: largest extent of the scene.
        half_height: of what the eye sees at the target's distance.
        grid_normal: of the grid's plane, a unit axis (3,).
        grid_distance: of the grid's plane from the origin, along the normal.
        grid_spacing: 1, 2 or 5 times a power of ten, about a tenth of the size.
        corner: upper left of the scene as seen from the eye, where the legend begins.
        is_planar: whether the scene is flat, and seen straight on.
    """

    eye: Array
    target: Array
    up: Array
    size: float
    half_height: float
    grid_normal: Array
    grid_distance: float
    grid_spacing: float
    corner: Array
    is_planar: bool

    @property
    def eye_up(self) -> Array:
        """The world axis that stays upright when the reader turns the view, (3,)."""
        axis: Array = np.eye(3)[int(np.argmax(np.abs(self.up)))]
        return axis

    def clip_radii(self, scene: Scene) -> dict[str, float]:
        """Returns the radius that each track is drawn with (m), by name.

        Thick enough to be seen, and each thinner than the one before it, so that all of a few that
        coincide still show; see `compute_shifts`.
        """
        low, high = 0.006 * self.size, 0.011 * self.size
        return {
            track.name: _THINNER**rank * float(np.clip(track.radius, low, high))
            for rank, track in enumerate(scene.tracks)
        }

    def compute_shifts(self, scene: Scene) -> dict[str, Array]:
        """Returns how far each track is drawn off its place, towards the eye, (3,), by name.

        In planar scenes, seen straight on, each hose lies in front of the one before it; the
        recorded points stay as they are. Elsewhere nothing is shifted.
        """
        ahead = self.eye - self.target
        step = 0.003 * self.size * ahead / np.linalg.norm(ahead) if self.is_planar else np.zeros(3)
        return {track.name: rank * step for rank, track in enumerate(scene.tracks)}

    def place_legend(self, n: int) -> Array:
        """Returns n places in a column, downwards from the corner, (n, 3)."""
        return self.corner - 0.14 * self.half_height * np.arange(n)[:, None] * self.up


def compute_framing(scene: Scene) -> Framing:
    """Looks straight on at a planar scene and from above at an angle at any other."""
    points = np.concatenate([track.points.reshape(-1, 3) for track in scene.tracks])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    size = max(float(extent.max()), 1e-6)
    flat = [axis for axis in (1, 2, 0) if extent[axis] < _FLAT * size]
    outward, up = _choose_directions(flat)
    axes = np.stack([np.cross(up, outward), up, outward])  # right, up, towards the eye
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    distance = _fit_distance(seen - middle, size)
    half_height = distance * _HALF_VIEW
    left = seen[:, 0].min() - middle[0] - 0.3 * half_height
    left = float(np.clip(left, -1.1 * half_height, -0.9 * half_height))
    normal = np.eye(3)[flat[0]] if flat else np.array([0.0, 0.0, 1.0])
    return Framing(
        eye=(middle + np.array([0.0, 0.0, distance])) @ axes,
        target=middle @ axes,
        up=up,
        size=size,
        half_height=half_height,
        grid_normal=normal,
        grid_distance=float(normal @ low),
        grid_spacing=round_spacing(0.1 * size),
        corner=(middle + np.array([left, 0.8 * half_height, 0.0])) @ axes,
        is_planar=bool(flat),
    )


def _fit_distance(seen: Array, size: float) -> float:
    """Returns how far from the target the eye sees all points (k, 3): right, up, towards it."""
    room = np.maximum(np.abs(seen[:, 0]) / _ASPECT, np.abs(seen[:, 1]))
    needed = float(np.max(1.25 * room / _HALF_VIEW + seen[:, 2]))
    return max(needed, 0.25 * size / _HALF_VIEW)


def _choose_directions(flat: list[int]) -> tuple[Array, Array]:
    """Returns the direction towards the eye and the upward one, perpendicular unit vectors."""
    if not flat:
        outward = np.array([0.5, -1.0, 0.4]) / np.linalg.norm([0.5, -1.0, 0.4])
        up = np.array([0.0, 0.0, 1.0]) - outward[2] * outward
        return outward, up / np.linalg.norm(up)
    outward = {0: (1.0, 0.0, 0.0), 1: (0.0, -1.0, 0.0), 2: (0.0, 0.0, 1.0)}[flat[0]]
    up = (0.0, 1.0, 0.0) if flat[0] == 2 else (0.0, 0.0, 1.0)
    return np.array(outward), np.array(up)


def round_spacing(length: float) -> float:
    """Returns the largest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1, 2, 5) if step <= length / power * (1 + 1e-9)))

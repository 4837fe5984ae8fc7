"""Outlines of obstacles for the pictures of `hose-mj compare`."""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.obstacles import Obstacle

_N_DIRECTIONS = 96


def find_outline(obstacle: Obstacle, view: tuple[int, int]) -> np.ndarray | None:
    """Outline (k, 2) of a shape as seen along the third axis: its farthest points all around.

    None for a plane, which has none.
    """
    if obstacle.kind == "plane":
        return None
    angle = np.linspace(0.0, 2.0 * np.pi, _N_DIRECTIONS, endpoint=False)
    directions = np.zeros((_N_DIRECTIONS, 3))
    directions[:, view[0]], directions[:, view[1]] = np.cos(angle), np.sin(angle)
    rotation = np.asarray(obstacle.rotation)
    radius, half, _ = np.asarray(obstacle.size)
    local = directions @ rotation
    if obstacle.kind == "box":
        far = np.sign(local) * obstacle.size
    elif obstacle.kind == "cylinder":
        far = np.zeros_like(local)
        across = np.linalg.norm(local[:, :2], axis=1, keepdims=True)
        far[:, :2] = radius * local[:, :2] / np.maximum(across, 1e-12)
        far[:, 2] = half * np.sign(local[:, 2])
    else:
        far = radius * local
        far[:, 2] += half * np.sign(local[:, 2])
    points = far @ rotation.T + obstacle.position
    return np.asarray(points[:, list(view)])


def find_outlines(obstacles: tuple[Obstacle, ...], view: tuple[int, int]) -> list[np.ndarray]:
    """Outlines of all that have one."""
    found = (find_outline(obstacle, view) for obstacle in obstacles)
    return [outline for outline in found if outline is not None]

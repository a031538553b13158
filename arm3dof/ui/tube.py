"""A thin tube along a path: lines are one pixel wide in a browser, a tube has a size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm3dof.state import Array
from arm3dof.ui import shapes

SIDES = 5


def tube(
    points: Array, radius: float, start: Sequence[float], end: Sequence[float]
) -> shapes.Shape | None:
    """Return a tube through points, coloured from one end to the other.

    Args:
        points: the path, shape (n, 3) [m]; points that stand still are left out.
        radius: radius of the tube [m].
        start: (red, green, blue) at the first point.
        end: (red, green, blue) at the last point.

    Returns:
        The mesh, or ``None`` when the path has no length.
    """
    path = _spread(points, radius / 4)
    if len(path) < 2:
        return None
    across, over = _frames(path)
    angles = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    rim = (
        np.cos(angles)[None, :, None] * across[:, None]
        + np.sin(angles)[None, :, None] * over[:, None]
    )
    vertices = (path[:, None] + radius * rim).reshape(-1, 3)
    share = np.linspace(0, 1, len(path))[:, None]
    colors = np.repeat((1 - share) * np.array(start) + share * np.array(end), SIDES, axis=0)
    here = np.arange(SIDES * (len(path) - 1)).reshape(-1, SIDES)
    beside = np.roll(here, -1, axis=1)
    quads = (here, beside, here + SIDES), (beside, beside + SIDES, here + SIDES)
    faces = np.concatenate([np.stack(corner, axis=-1).reshape(-1, 3) for corner in quads])
    return shapes.triangles(vertices, faces, colors=colors, normals=rim.reshape(-1, 3))


def _spread(points: Array, least: float) -> Array:
    """Keep the points that lie at least ``least`` from the one kept before."""
    kept = list(points[:1])
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= least:
            kept.append(point)
    return np.array(kept).reshape(-1, 3)


def _frames(path: Array) -> tuple[Array, Array]:
    """Return two unit vectors across the path at each point, carried along without twist."""
    tangent = np.gradient(path, axis=0)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.where(length > 0, length, 1.0)
    across = np.empty_like(path)
    side = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for row, along in enumerate(tangent):
        side = side - along * (side @ along)
        side = side / max(float(np.linalg.norm(side)), 1e-12)
        across[row] = side
    return across, np.cross(tangent, across)

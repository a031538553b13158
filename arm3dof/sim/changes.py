"""Which part of a picture has changed: where the things that moved were, and where they are."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from arm3dof.sim.engine import mujoco
from arm3dof.state import Array

_MARGIN = 2  # around what has moved [px]
_NEAREST = 0.02  # what comes nearer to the lens may cover anything [m]
_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


class Window(NamedTuple):
    """A part of a picture, whole pixels."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """The same part of an array whose first axes are rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


class Changes:
    """Tells from picture to picture what has to be drawn anew."""

    def __init__(self, model: mujoco.MjModel, group: int, width: int, height: int) -> None:
        """Begin without a picture.

        Args:
            model: the world.
            group: of the geoms that are drawn.
            width: of the pictures [px].
            height: of the pictures [px].
        """
        self._geoms = np.flatnonzero(model.geom_group == group)
        boxes = model.geom_aabb[self._geoms]  # centres and half sides, in the geoms' own frames
        self._corners = boxes[:, None, :3] + _CORNERS * boxes[:, None, 3:]
        self._size = width, height
        self._drawn: tuple[Array, Array, Array, Array] | None = None

    def window(
        self, data: mujoco.MjData, camera_matrix: Array, transform_base_camera: Array
    ) -> Window | None:
        """Return what to draw of a picture that is drawn now; ``None`` where nothing has changed.

        Args:
            data: the world's state, its kinematics computed.
            camera_matrix: intrinsics, shape (3, 3) [px].
            transform_base_camera: pose of the optical frame, shape (4, 4).
        """
        places, turns = data.geom_xpos[self._geoms], data.geom_xmat[self._geoms]
        now = places, turns, np.array(camera_matrix), np.array(transform_base_camera)
        before, self._drawn = self._drawn, now
        whole = Window(0, 0, *self._size)
        if before is None or not all(map(np.array_equal, before[2:], now[2:])):
            return whole
        moved = (before[0] != places).any(axis=1) | (before[1] != turns).any(axis=1)
        if not moved.any():
            return None
        points = np.concatenate([self._points(moved, *it[:2]) for it in (before, now)])
        x, y, z = ((points - now[3][:3, 3]) @ now[3][:3, :3]).T
        if z.min() < _NEAREST:
            return whole
        u = now[2][0, 0] * x / z + now[2][0, 2]
        v = now[2][1, 1] * y / z + now[2][1, 2]
        ends = [(int(np.floor(it.min())), int(np.ceil(it.max())) + 1) for it in (u, v)]
        (left, right), (top, bottom) = (
            (max(low - _MARGIN, 0), min(high + _MARGIN, size))
            for (low, high), size in zip(ends, self._size, strict=True)
        )
        return Window(left, top, right, bottom) if left < right and top < bottom else None

    def _points(self, moved: Array, places: Array, turns: Array) -> Array:
        """Return the corners of the boxes around some geoms in the base frame, shape (n, 3)."""
        turned = self._corners[moved] @ turns[moved].reshape(-1, 3, 3).transpose(0, 2, 1)
        points: Array = (turned + places[moved, None]).reshape(-1, 3)
        return points

"""Upright solids whose foot is on a table, of any width and height: silhouettes to be fitted.

Where the table is, is known, so a state is (x, y, width, height), of the middle of the foot in the
base frame [m], and a box adds its turn about the vertical [rad]. All but the turn move the points
of a solid in straight lines, so their derivatives are the same wherever it stands.
"""

from __future__ import annotations

import math

import numpy as np

from arm3dof.state import Array
from arm3dof.vision.camera import Camera
from arm3dof.vision.silhouette import CIRCLE, Part, Solid

# of each drum: its share of the width, and where it begins and ends as shares of the height
_DRUMS = {
    "cylinder": ((1.0, 0.0, 1.0),),
    "bottle": ((1.0, 0.0, 0.7), (0.4, 0.7, 1.0)),
}
_FOOT = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) / 2

KINDS = ("cylinder", "box", "bottle")
"""Shapes of things, the commonest first; a ``box`` has a square foot."""


def upright(kind: str, camera: Camera, table_height: float) -> Solid:
    """Return a solid of ``KINDS`` that stands on a table.

    Args:
        kind: its shape.
        camera: the camera that sees it.
        table_height: of the table in the base frame [m].
    """
    origin = camera.to_camera([0.0, 0.0, table_height])
    axes = camera.transform_base_camera[:3, :3]  # of the base frame, in the optical one
    if kind == "box":
        return _box(origin, axes)
    drums = [_drum(axes, *shape) for shape in _DRUMS[kind]]
    return lambda state: tuple((origin + slopes @ state, slopes) for slopes in drums)


def across(kind: str, state: Array) -> float:
    """Return the diameter of the upright cylinder that holds a solid [m]."""
    return float(state[2]) * (math.sqrt(2) if kind == "box" else 1.0)


def _drum(axes: Array, share: float, low: float, high: float) -> Array:
    """Return the derivatives of a drum's points by the state, shape (k, 3, 4)."""
    rim = share / 2 * CIRCLE
    return np.concatenate([_slopes(axes, rim, low), _slopes(axes, rim, high)])


def _box(origin: Array, axes: Array) -> Solid:
    def at(state: Array) -> tuple[Part, ...]:
        c, s = math.cos(state[4]), math.sin(state[4])
        foot = _FOOT @ np.array([[c, s], [-s, c]])
        turned = np.column_stack([-foot[:, 1], foot[:, 0]]) @ axes[:2] * state[2]
        straight = np.concatenate([_slopes(axes, foot, 0.0), _slopes(axes, foot, 1.0)])
        slopes = np.concatenate([straight, np.tile(turned, (2, 1))[:, :, None]], axis=2)
        return ((origin + straight @ state[:4], slopes),)

    return at


def _slopes(axes: Array, foot: Array, level: float) -> Array:
    """Return derivatives by (x, y, width, height) of points over a foot of width 1, (k, 3, 4)."""
    slopes = np.empty((len(foot), 3, 4))
    slopes[:, :, 0], slopes[:, :, 1] = axes[0], axes[1]
    slopes[:, :, 2], slopes[:, :, 3] = foot @ axes[:2], level * axes[2]
    return slopes

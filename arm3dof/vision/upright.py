"""Upright solids whose foot is on a table, of any width and height, fitted by their silhouettes.

Where the table is, is known, so a state is (x, y, width, height), of the middle of the foot in the
base frame [m], and a box adds its turn about the vertical [rad]. All but the turn move the points
of a solid in straight lines, so their derivatives are the same wherever it stands.
"""

from __future__ import annotations

import math

import numpy as np

from arm3dof.state import Array
from arm3dof.vision import silhouette
from arm3dof.vision.camera import Camera
from arm3dof.vision.silhouette import CIRCLE, Fit, Part, Solid

# of each drum: its share of the width, and where it begins and ends as shares of the height
_DRUMS = {
    "cylinder": ((1.0, 0.0, 1.0),),
    "bottle": ((1.0, 0.0, 0.7), (0.4, 0.7, 1.0)),
}
_FOOT = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) / 2

_WIDTHS = (0.005, 0.2)  # [m]
_HEIGHTS = (0.005, 0.5)  # [m]
_TURNS = (0.0, math.pi / 8, math.pi / 4, math.pi * 3 / 8)  # of a box that are tried [rad]
_TRIED, _FAR_PX = 3, 10.0  # so many are followed, those that look best from afar
_FEW, _COARSE = 60, 7  # points, and steps, that tell the shape
_HOPELESS = 0.8  # a loss that all points would not mend
_LIKE_ENOUGH = 0.1  # a loss that another shape would hardly better
_BOX = 0.8  # width of a box over that which it looks to have

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


def first_guess(rays: Array, camera: Camera, table_height: float) -> Array | None:
    """Return x, y, width and height as the shadow has them that a lamp in the lens would cast.

    Args:
        rays: lines of sight to an outline, in the optical frame, shape (n, 3).
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        A state of a cylinder, shape (4,) [m]; None when not every line of sight meets the table.
    """
    sights = rays @ camera.transform_base_camera[:3, :3].T
    above = float(camera.position[2]) - table_height
    if above <= 0 or (sights[:, 2] >= 0).any():
        return None
    shadow = -above * sights[:, :2] / sights[:, 2:]
    ahead = shadow.mean(axis=0)
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    along, aside = shadow @ ahead, shadow @ [-ahead[1], ahead[0]]
    # the shadow begins at the foot, and ends behind the top, by as much farther as that is higher
    near, far = float(along.min()), float(along.max())
    width = min(float(np.ptp(aside)), far - near)
    height = above * (1 - (near + width) / far) if far > 0 else 0.0
    middle = camera.position[:2] + (near + width / 2) * ahead
    middle = middle + (aside.max() + aside.min()) / 2 * np.array([-ahead[1], ahead[0]])
    return np.array([*middle, width, np.clip(height, 0.3 * width, 4 * width)])


def fitted(
    start: Array, points: Array, pixel: float, camera: Camera, table_height: float
) -> tuple[str, Fit]:
    """Return the shape whose silhouette is most like an outline; the first that is like enough.

    A bottle whose neck is not seen beyond its belly is a cylinder by its outline. A few of the
    points tell which shape it is, or that it is none; all of them tell where it stands.

    Args:
        start: about where it stands and how large it is, shape (4,) [m]; see ``first_guess``.
        points: of the outline, (X / Z, Y / Z) in the optical frame, shape (n, 2).
        pixel: size of a pixel in their units.
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        The shape, one of ``KINDS``, and its fit.
    """
    few = points[:: max(len(points) // _FEW, 1)]
    found: list[tuple[str, Fit]] = []
    for kind in KINDS:
        solid = upright(kind, camera, table_height)
        compared = [silhouette.compare(solid, it, few, pixel) for it in _starts(kind, start)]
        for begin in sorted(compared, key=lambda it: it.loss(_FAR_PX))[:_TRIED]:
            found.append((kind, silhouette.fit(solid, begin.state, few, pixel, _COARSE)))
            if found[-1][1].loss() < _LIKE_ENOUGH:
                break
        if found[-1][1].loss() < _LIKE_ENOUGH:
            break
    kind, coarse = min(found, key=lambda it: it[1].loss())
    solid = upright(kind, camera, table_height)
    if coarse.loss() > _HOPELESS:
        return kind, silhouette.compare(solid, coarse.state, points, pixel)
    return kind, silhouette.fit(solid, coarse.state, points, pixel)


def is_possible(state: Array) -> bool:
    """Whether a state is finite, and of a width and height that a thing can have."""
    width, height = state[2:4].tolist()
    return bool(
        np.isfinite(state).all()
        and _WIDTHS[0] <= width <= _WIDTHS[1]
        and _HEIGHTS[0] <= height <= _HEIGHTS[1]
    )


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


def _starts(kind: str, start: Array) -> list[Array]:
    """Return states to fit a solid from."""
    if kind != "box":
        return [start]
    return [np.array([*start[:2], _BOX * start[2], start[3], turn]) for turn in _TURNS]

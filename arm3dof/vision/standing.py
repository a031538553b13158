"""Where a thing stands on a known table, and how large it is, from its outline alone.

An upright thing on the table has few unknowns: its place (x, y), width, height, and how it is
turned where it is a box. So a camera that knows where the table is needs no known width, and its
error no longer grows with the square of the distance, as that of (2) does: the foot of a thing is
where the line of sight meets the table. Cylinder, bottle and box are moved and sized until their
silhouettes are the measured outline, and the best one tells. Where none is, something hides a part
of the thing, or it is none of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.state import Array, frozen_array
from arm3dof.vision import silhouette
from arm3dof.vision.camera import Camera
from arm3dof.vision.placing import covariances, edge_sigma, is_partial
from arm3dof.vision.silhouette import Fit
from arm3dof.vision.upright import KINDS, across, upright

SHAPE_SIGMA_M = 0.001
"""What the place errs by because things are not quite what they are taken for [m]."""

_WIDTHS = (0.005, 0.2)  # [m]
_HEIGHTS = (0.005, 0.5)  # [m]
# three shapes of any size pass for more than one of known width does: their fits must be closer.
# Rendered pictures of whole things leave 0.04, in the worst light 0.09
_UNLIKE = 0.2
_FLAT = 0.2  # what is flatter than this share of its width is a part of something higher
_TURNS = (0.0, math.pi / 8, math.pi / 4, math.pi * 3 / 8)  # of a box that are tried [rad]
_TRIED, _FAR_PX = 3, 10.0  # so many are followed, those that look best from afar
_FEW, _COARSE = 60, 7  # points, and steps, that tell the shape
_HOPELESS = 0.8  # a loss that all points would not mend
_LIKE_ENOUGH = 0.1  # a loss that another shape would hardly better
_BOX = 0.8  # width of a box over that which it looks to have


@dataclass(frozen=True, eq=False)
class Standing:
    """A thing that stands on the table.

    Attributes:
        target: name of its target, commonly its colour.
        x: of the middle of its foot, in the base frame [m].
        y: of the middle of its foot [m].
        width_m: diameter of the upright cylinder that holds it [m].
        height_m: from foot to top [m].
        covariance: of (x, y), shape (2, 2) [m^2].
        hidden: whether something seems to hide a part of it: then all of this is a rough guess,
            enough to keep clear of it.
    """

    target: str
    x: float
    y: float
    width_m: float
    height_m: float
    covariance: Array
    hidden: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, 2, 2, name="cov"))

    @property
    def sigma_m(self) -> float:
        """Standard deviation of its place in the less certain direction [m]."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))

    def distance_to(self, x: float, y: float) -> float:
        """Return how far its middle is from a point of the table [m]."""
        return float(np.hypot(self.x - x, self.y - y))


def guess(target: str, outline: ArrayLike, camera: Camera, table_height: float) -> Standing | None:
    """Say in no time roughly where on the table a thing would have to stand, and how large it is.

    Args:
        target: name of the target.
        outline: points (u, v) of it, shape (n, 2) [px].
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        A thing, ``hidden``; None when no line of sight to it meets the table.
    """
    start = _first_guess(camera.rays(outline), camera, table_height)
    return None if start is None else _guessed(target, start)


def stand(target: str, outline: ArrayLike, camera: Camera, table_height: float) -> Standing | None:
    """Stand what has an outline on the table.

    Args:
        target: name of the target.
        outline: points (u, v) of it, shape (n, 2) [px].
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        The thing; ``hidden`` when its outline is not that of a whole one. None when nothing that
        stands on the table looks nearly like that.
    """
    rays, pixel = camera.rays(outline), 1 / camera.focal_px[0]
    start = _first_guess(rays, camera, table_height)
    if start is None:
        return None
    points = rays[:, :2]
    kind, best = _best(start, points, pixel, camera, table_height)
    if not _is_possible(best.state):
        return _guessed(target, start) if _is_possible(start) else None
    noise, light = covariances(best, edge_sigma(camera.gamma))
    x, y, _, height = best.state[:4].tolist()
    doubt = _doubt(camera, np.array([x, y, table_height]))
    return Standing(
        target,
        x,
        y,
        across(kind, best.state),
        height,
        (noise + light)[:2, :2] + doubt + SHAPE_SIGMA_M**2 * np.eye(2),
        is_partial(best, points, pixel)
        or best.loss() > _UNLIKE
        or height < _FLAT * float(best.state[2]),
    )


def _guessed(target: str, start: Array) -> Standing:
    """Return a thing of which too little is seen to fit anything to it."""
    x, y, width, height = start.tolist()
    return Standing(target, x, y, width, height, width**2 / 4 * np.eye(2), hidden=True)


def _doubt(camera: Camera, p_base: Array) -> Array:
    """Return what a camera's doubt makes of a point of the table, covariance, shape (2, 2) [m^2].

    An error moves the line of sight, and the point to where the line now meets the table.
    """
    p, doubt, up = camera.to_camera(p_base), camera.doubt, camera.up
    aside = np.array([p[0], p[1], 0.0]) * doubt.focal_px
    centre = np.diag([1.0, 1.0, 0.0]) * (p[2] * doubt.centre_px) ** 2
    lens = (np.outer(aside, aside) + centre) / camera.focal_px[0] ** 2
    turned = doubt.rotation_rad**2 * (p @ p * np.eye(3) - np.outer(p, p))
    onto = camera.transform_base_camera[:2, :3] @ (np.eye(3) - np.outer(p, up) / (up @ p))
    return np.asarray(onto @ (lens + turned + doubt.position_m**2 * np.eye(3)) @ onto.T)


def _first_guess(rays: Array, camera: Camera, table_height: float) -> Array | None:
    """Return x, y, width and height as the shadow has them that a lamp in the lens would cast."""
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


def _best(
    start: Array, points: Array, pixel: float, camera: Camera, table_height: float
) -> tuple[str, Fit]:
    """Return the shape whose silhouette is most like the outline; the first that is like enough.

    A bottle whose neck is not seen beyond its belly is a cylinder by its outline. A few of the
    points tell which shape it is, or that it is none; all of them tell where it stands.
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


def _starts(kind: str, start: Array) -> list[Array]:
    """Return states to fit a solid from."""
    if kind != "box":
        return [start]
    return [np.array([*start[:2], _BOX * start[2], start[3], turn]) for turn in _TURNS]


def _is_possible(state: Array) -> bool:
    width, height = state[2:4].tolist()
    return bool(
        np.isfinite(state).all()
        and _WIDTHS[0] <= width <= _WIDTHS[1]
        and _HEIGHTS[0] <= height <= _HEIGHTS[1]
    )

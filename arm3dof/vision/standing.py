"""Where a thing stands on a known table, and how large it is, from its outline alone.

An upright thing on the table has few unknowns: its place (x, y), width, height, and how it is
turned where it is a box. So a camera that knows where the table is needs no known width, and its
error no longer grows with the square of the distance, as that of (2) does: the foot of a thing is
where the line of sight meets the table. Cylinder, bottle and box are moved and sized until their
silhouettes are the measured outline, and the best one tells. Where none is, something hides a part
of the thing, or it is none of these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.state import Array, frozen_array
from arm3dof.vision.camera import Camera
from arm3dof.vision.placing import covariances, edge_sigma, is_partial
from arm3dof.vision.upright import across, first_guess, fitted, is_possible

SHAPE_SIGMA_M = 0.001
"""What the place errs by because things are not quite what they are taken for [m]."""

# three shapes of any size pass for more than one of known width does: their fits must be closer.
# Rendered pictures of whole things leave 0.04, in the worst light 0.09
_UNLIKE = 0.2
_FLAT = 0.2  # what is flatter than this share of its width is a part of something higher


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
        A thing, ``hidden``; None when not every line of sight to it meets the table.
    """
    start = first_guess(camera.rays(outline), camera, table_height)
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
    start = first_guess(rays, camera, table_height)
    if start is None:
        return None
    points = rays[:, :2]
    kind, best = fitted(start, points, pixel, camera, table_height)
    if not is_possible(best.state):
        return _guessed(target, start) if is_possible(start) else None
    noise, light = covariances(best, edge_sigma(camera.gamma))
    hidden = (
        is_partial(best, points, pixel)
        or best.loss() > _UNLIKE
        or best.state[3] < _FLAT * best.state[2]
    )
    return standing(target, kind, best.state, noise + light, camera, table_height, hidden=hidden)


def standing(
    target: str,
    kind: str,
    state: Array,
    covariance: Array,
    camera: Camera,
    table_height: float,
    *,
    hidden: bool,
) -> Standing:
    """Return a thing by the solid that was fitted to it.

    Args:
        target: name of the target.
        kind: shape of the solid, one of ``upright.KINDS``.
        state: of the solid.
        covariance: of the state, by what the picture leaves open, at least shape (2, 2) [m^2].
        camera: the camera, whose doubt is added.
        table_height: of the table in the base frame [m].
        hidden: whether a part of it is not seen.
    """
    x, y, _, height = state[:4].tolist()
    doubt = _doubt(camera, np.array([x, y, table_height]))
    place = covariance[:2, :2] + doubt + SHAPE_SIGMA_M**2 * np.eye(2)
    return Standing(target, x, y, across(kind, state), height, place, hidden)


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

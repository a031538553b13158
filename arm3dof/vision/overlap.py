"""Two things of one colour that overlap in the picture: one patch, and no upright thing's outline.

Where they meet the patch has a neck, and each side of it shows most of one thing. So each side
tells what stands there and about where; then both silhouettes together are fitted to the whole
outline. Only what that explains is believed.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.state import Array
from arm3dof.vision import silhouette
from arm3dof.vision.camera import Camera
from arm3dof.vision.placing import covariances, edge_sigma, is_partial
from arm3dof.vision.silhouette import Part, Solid
from arm3dof.vision.standing import Standing, standing
from arm3dof.vision.upright import first_guess, fitted, is_possible, upright

_SAMPLES = 120  # corners of a patch between which a neck is looked for
_LEAST_SHARE = 0.15  # of the outline on either side of it
_NECK = 0.5  # most of a neck's width over the way around; for a circle it is 0.64
_NOTCH = 0.01  # of the outline by which one end of a neck lies within the patch's convex hull
_FEWEST = 20  # points of either side
_UNLIKE = 0.12  # two solids can be made like much: they must be closer than one
_HEIGHT_SIGMA_M = 0.004  # a height that is less certain is not known [m]


def stand_both(
    target: str, outline: ArrayLike, contour: ArrayLike, camera: Camera, table_height: float
) -> tuple[Standing, Standing] | None:
    """Stand two things on the table that share an outline.

    Args:
        target: name of their target.
        outline: points (u, v) of it in any order, shape (n, 2) [px].
        contour: corners of the patch in order, shape (k, 2) [px].
        camera: the camera.
        table_height: of the table in the base frame [m].

    Returns:
        The nearer thing, ``hidden`` where its height is not known, and the farther one, which
        always is. None when two upright things do not look like that.
    """
    outline = np.asarray(outline, dtype=np.float64)
    ends = neck(contour)
    if ends is None:
        return None
    along, away = ends[1] - ends[0], outline - ends[0]
    left = along[0] * away[:, 1] > along[1] * away[:, 0]
    rays, pixel = camera.rays(outline), 1 / camera.focal_px[0]
    begun = [_begin(side, pixel, camera, table_height) for side in (rays[left], rays[~left])]
    if begun[0] is None or begun[1] is None:
        return None
    (kind, start), (behind, then) = sorted(
        (begun[0], begun[1]), key=lambda it: float(np.hypot(*(it[1][:2] - camera.position[:2])))
    )
    solids = upright(kind, camera, table_height), upright(behind, camera, table_height)
    split, points = len(start), rays[:, :2]
    best = silhouette.fit(_both(*solids, split), np.concatenate([start, then]), points, pixel)
    states = best.state[:split], best.state[split:]
    if not all(map(is_possible, states)):
        return None
    if is_partial(best, points, pixel) or best.loss() > _UNLIKE:
        return None
    noise, light = covariances(best, edge_sigma(camera.gamma))
    covariance = noise + light
    vague = bool(covariance[3, 3] > _HEIGHT_SIGMA_M**2)
    place = camera, table_height
    near = standing(target, kind, states[0], covariance, *place, hidden=vague)
    far = standing(target, behind, states[1], covariance[split:, split:], *place, hidden=True)
    apart = near.distance_to(far.x, far.y)
    # one does not stand in the other
    return (near, far) if apart > (near.width_m + far.width_m) / 2 else None


def neck(contour: ArrayLike) -> NDArray[np.float64] | None:
    """Return both ends of a patch's narrowest place, shape (2, 2) [px]; None when it has none.

    It is narrow where a straight way across is short for the way around, and there the patch has a
    notch, which a part of one convex thing has not.

    Args:
        contour: corners of the patch in order, shape (k, 2) [px].
    """
    corners = np.asarray(contour, dtype=np.float64).reshape(-1, 2)
    steps = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    way, length = np.concatenate([[0.0], np.cumsum(steps)]), float(steps.sum())
    at = np.linspace(0, length, _SAMPLES, endpoint=False)
    closed = np.vstack([corners, corners[:1]])
    points = np.column_stack([np.interp(at, way, column) for column in closed.T])
    around = np.abs(at[:, None] - at)
    around = np.minimum(around, length - around)
    across = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    around[around < _LEAST_SHARE * length] = 0.0
    hull = cv2.convexHull(corners.astype(np.float32))
    within = np.array([cv2.pointPolygonTest(hull, tuple(it), True) for it in points.tolist()])
    notched = np.maximum(within[:, None], within) > _NOTCH * length
    ratio = np.divide(across, around, out=np.ones_like(across), where=notched & (around > 0))
    first, last = divmod(int(ratio.argmin()), _SAMPLES)
    return points[[first, last]] if ratio[first, last] < _NECK else None


def _begin(
    rays: Array, pixel: float, camera: Camera, table_height: float
) -> tuple[str, Array] | None:
    """Return the shape and about the state of what one side of a neck shows most of."""
    start = first_guess(rays, camera, table_height) if len(rays) >= _FEWEST else None
    if start is None:
        return None
    kind, found = fitted(start, rays[:, :2], pixel, camera, table_height)
    return (kind, found.state) if is_possible(found.state) else ("cylinder", start)


def _both(near: Solid, far: Solid, split: int) -> Solid:
    """Return two solids as one, whose state is both of theirs; the first has ``split`` numbers."""

    def at(state: Array) -> tuple[Part, ...]:
        after = len(state) - split
        return (
            *((body, _widened(slopes, 0, after)) for body, slopes in near(state[:split])),
            *((body, _widened(slopes, split, 0)) for body, slopes in far(state[split:])),
        )

    return at


def _widened(slopes: Array, before: int, after: int) -> Array:
    """Return derivatives by a state with more numbers, on which nothing depends."""
    return np.pad(slopes, ((0, 0), (0, 0), (before, after)))

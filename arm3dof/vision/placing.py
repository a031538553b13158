"""Where a thing of known width is, from the lines of sight to its outline.

Lines of sight ``rays`` are points (x, y, 1) of the optical frame, shape (n, 3), a ``pixel`` is
their distance for one, 1 / focal length, and ``up`` is the base frame's z axis in the optical
frame, shape (3,). A flat face is measured as the paper does, by its width; a solid is moved until
its silhouette is the measured outline.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

import numpy as np

from arm3dof.state import Array
from arm3dof.vision import silhouette
from arm3dof.vision.colour import Shape
from arm3dof.vision.outline import extent
from arm3dof.vision.silhouette import Fit, Solid

LEAST_PX = 3.0
"""What is narrower cannot be measured [px]."""

# points of an outline further than this from the silhouette are another thing's: a share of the
# width, which is less than the pixels below where the thing is small, and more where it is large
_STRAY_SMALL, _STRAY_PX, _STRAY_LARGE = 0.06, 1.2, 0.03
_MOST_STRAY = 0.08
_EDGE_SIGMA_PX = 0.11
_KNOWN_EDGE_SIGMA_PX = 0.065
# neighbouring points of an outline err alike: so many are worth one
_ALIKE = 6.0
_LEAST_NOISE_PX = 0.05
# a width rests on two edges alone, where an outline has many
_FLAT = 2.2
# what is flatter than this share of its width is the top of a thing whose sides are not seen
_LEAST_HEIGHT = 0.1
_TURNS = 6  # of a cube that are tried


_TALL = ("cylinder", "bottle")  # shapes whose last state is their height


class Refusal(enum.Enum):
    """Why a patch of the right colour is not measured."""

    BORDER = "it touches the edge of the picture, so its width is not seen whole"
    THIN = "it is too thin to measure"
    AFLOAT = "its foot is not on the table, as if something hid it or it were something else"
    PARTIAL = "its outline is not that of its shape, as if something hid a part of it"


class Placement(NamedTuple):
    """Where a thing is, and how far that may be off by what light and noise do to its outline.

    Attributes:
        p_camera: its centre, shape (3,) [m].
        foot: height of its lowest point above the lens [m]; None when that is not seen.
        noise: covariance of ``p_camera`` and ``foot`` by noise, shape (4, 4) [m^2].
        light: the same by light and shade at the edges, shape (4, 4) [m^2].
    """

    p_camera: Array
    foot: float | None
    noise: Array
    light: Array


def place(
    rays: Array, shape: Shape, width_m: float, pixel: float, up: Array, edge_px: float
) -> Placement | Refusal:
    """Place a thing.

    Args:
        rays: lines of sight to its outline, shape (n, 3).
        shape: what it is.
        width_m: its true width [m].
        pixel: the size of a pixel in ``rays``.
        up: the vertical, shape (3,).
        edge_px: standard deviation of what light does to all of an edge [px].
    """
    if np.ptp(rays[:, :2], axis=0).min() < LEAST_PX * pixel:
        return Refusal.THIN
    if shape == "flat":
        return _place_flat(rays, width_m, pixel, up, edge_px)
    solid, starts = _solid(rays, shape, width_m, up)
    points = rays[:, :2]
    best = min(
        (silhouette.fit(solid, start, points, pixel) for start in starts),
        key=lambda it: it.loss(),
    )
    sound = np.isfinite(best.state).all() and best.state[2] > 0
    if (
        not sound
        or is_partial(best, points, pixel)
        or (len(best.state) > 3 and shape in _TALL and best.state[3] < _LEAST_HEIGHT * width_m)
    ):
        return Refusal.PARTIAL
    slope, offset = _foot(shape, best, width_m, up)
    both = np.vstack([np.eye(3, len(best.state)), slope])
    foot = None if offset is None else float(slope @ best.state) + offset
    noise, light = (both @ it @ both.T for it in covariances(best, edge_px))
    return Placement(best.state[:3], foot, noise, light)


def edge_sigma(gamma: float | None) -> float:
    """Return what light and shade do to an edge beyond the noise that shows in it [px].

    Args:
        gamma: how the camera encodes light; None when that is not known.
    """
    return _EDGE_SIGMA_PX if gamma is None else _KNOWN_EDGE_SIGMA_PX


def is_partial(found: Fit, points: Array, pixel: float) -> bool:
    """Whether an outline is not that of the solid that was fitted to it.

    Args:
        found: the fit.
        points: the outline, (x, y) at depth 1, shape (n, 2).
        pixel: the size of a pixel in them.
    """
    width = math.sqrt(float(np.prod(np.ptp(points, axis=0)))) / pixel
    most = max(min(_STRAY_SMALL * width, _STRAY_PX), _STRAY_LARGE * width)
    return bool(np.mean(np.abs(found.off_px) > most) > _MOST_STRAY)


def _place_flat(rays: Array, width_m: float, pixel: float, up: Array, edge_px: float) -> Placement:
    """Place a face that is parallel to the picture: (2) with W' / (P / F) written in rays."""
    across = extent(rays[:, 0], rays[:, 1], pixel)
    down = extent(rays[:, 1], rays[:, 0], pixel)
    ray = np.array([across.middle, down.middle, 1.0])
    depth = width_m / across.size
    both = np.vstack([np.eye(3), up])
    noise, light = (
        both @ _flat_covariance(ray * depth, edge, across.size) @ both.T
        for edge in (across.sigma, _FLAT * edge_px * pixel)
    )
    return Placement(ray * depth, None, noise, light)


def _flat_covariance(p_camera: Array, edge: float, size: float) -> Array:
    """Return what an error of each edge does to a flat face, shape (3, 3)."""
    depth = p_camera[2]
    aside = depth * edge / math.sqrt(2)
    along = math.sqrt(2) * edge / size
    result: Array = along**2 * np.outer(p_camera, p_camera) + np.diag([aside**2, aside**2, 0.0])
    return result


def _solid(rays: Array, shape: Shape, width_m: float, up: Array) -> tuple[Solid, list[Array]]:
    """Return a solid, and states from which to look for its best one."""
    points = rays[:, :2]
    begin = rays.mean(axis=0) * width_m / float(np.sqrt(np.prod(np.ptp(points, axis=0))))
    if shape == "ball":
        solid = silhouette.ball(width_m / 2)
        return solid, [silhouette.moved(solid, begin, points)]
    if shape == "cube":
        solid = silhouette.cube(width_m, up)
        turns = np.arange(_TURNS) * math.pi / 2 / _TURNS
        starts = [silhouette.moved(solid, np.array([*begin, turn]), points) for turn in turns]
        starts.sort(key=lambda it: silhouette.compare(solid, it, points, 1.0).loss(0.01))
        return solid, starts[:2]
    if _from_above(rays, up):
        # its top is a disc that faces the camera, and its sides tell nothing
        solid = silhouette.disc(width_m / 2, up)
        return solid, [silhouette.moved(solid, begin, points)]
    make = silhouette.bottle if shape == "bottle" else silhouette.cylinder
    solid = make(width_m / 2, up)
    height = width_m * _slimness(points, up)
    return solid, [silhouette.moved(solid, np.array([*begin, height]), points)]


def _slimness(points: Array, up: Array) -> float:
    """Return how high an outline is for its width, between 0.5 and 4."""
    upward = up[:2] / max(float(np.hypot(*up[:2])), 1e-9)
    high, wide = np.ptp(points @ upward), np.ptp(points @ [upward[1], -upward[0]])
    return float(np.clip(high / wide, 0.5, 4.0))


def _from_above(rays: Array, up: Array) -> bool:
    """Whether the lens looks so steeply down that an upright thing shows its top alone."""
    sight = rays.mean(axis=0)
    sight = sight / np.linalg.norm(sight)
    slant = math.acos(min(abs(float(up @ sight)), 1.0))
    spread = math.acos(min(float((rays @ sight / np.linalg.norm(rays, axis=1)).min()), 1.0))
    return slant < 1.2 * spread


def covariances(found: Fit, edge_px: float) -> tuple[Array, Array]:
    """Return the covariances of a fit by noise and by light, shape (m, m) each.

    Noise throws each part of the outline where it likes. Light and shade move all of it outwards,
    or one side out and the other in.

    Args:
        found: the fit.
        edge_px: standard deviation of what light does to all of an edge [px].
    """
    gain = found.gain()
    noise = max(float(np.median(np.abs(found.off_px))) / 0.6745, _LEAST_NOISE_PX)
    moved = gain @ np.column_stack([np.ones(len(found.normals)), found.normals])
    return noise**2 * _ALIKE * gain @ gain.T, edge_px**2 * moved @ moved.T


def _foot(shape: Shape, found: Fit, width_m: float, up: Array) -> tuple[Array, float | None]:
    """Return how the height of the lowest point hangs on the state: its slope and its offset.

    The offset is None where only the top was seen.
    """
    slope = np.concatenate([up, np.zeros(len(found.state) - 3)])
    if shape not in _TALL:
        return slope, -width_m / 2
    if len(slope) == 3:
        return slope, None
    slope[3] = -0.5
    return slope, 0.0

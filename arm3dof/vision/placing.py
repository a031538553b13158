"""Where a thing of known width is, from the lines of sight to its outline.

Each function takes lines of sight ``rays``, points (x, y, 1) of the optical frame, shape (n, 3);
the thing's true width ``width_m`` [m]; and the size of a ``pixel`` in them, 1 / focal length.
``up`` is the base frame's z axis in the optical frame, shape (3,). Each returns the thing's centre,
shape (3,) [m], with the extent that its distance was measured on, or why it cannot be placed.
"""

from __future__ import annotations

import enum
import math

import numpy as np

from arm3dof.state import Array
from arm3dof.vision.outline import Extent, extent

LEAST_PX = 3.0
"""What is narrower cannot be measured [px]."""

# a ball's width and height may give depths that differ by this share
_ROUNDNESS = 0.12


class Refusal(enum.Enum):
    """Why a patch of the right colour is not measured."""

    BORDER = "it touches the edge of the picture, so its width is not seen whole"
    THIN = "it is too thin to measure"
    PARTIAL = "it is not as high as it is wide, as if something hid a part of the ball"


def place_flat(rays: Array, width_m: float, pixel: float) -> tuple[Array, Extent] | Refusal:
    """Place a face that is parallel to the picture: (2) with W' / (P / F) written in rays."""
    across = extent(rays[:, 0], rays[:, 1], pixel)
    down = extent(rays[:, 1], rays[:, 0], pixel)
    if across.size < LEAST_PX * pixel:
        return Refusal.THIN
    return np.array([across.middle, down.middle, 1.0]) * (width_m / across.size), across


def place_ball(rays: Array, width_m: float, pixel: float) -> tuple[Array, Extent] | Refusal:
    """Place a ball by the four planes through the lens that touch it, or refuse half a ball.

    Seen along the picture's y axis the ball is a circle of radius W / 2. Lines of sight to its
    left and right edges touch that circle; half the angle between them is alpha, and
    sin(alpha) = (W / 2) / rho gives the distance rho to its centre. Likewise along the x axis.
    """
    across = extent(np.arctan(rays[:, 0]), rays[:, 1], pixel)
    down = extent(np.arctan(rays[:, 1]), rays[:, 0], pixel)
    if min(across.size, down.size) < LEAST_PX * pixel:
        return Refusal.THIN
    depth = width_m / 2 / math.sin(across.size / 2) * math.cos(across.middle)
    again = width_m / 2 / math.sin(down.size / 2) * math.cos(down.middle)
    if abs(math.log(again / depth)) > _ROUNDNESS:
        return Refusal.PARTIAL
    return depth * np.array([math.tan(across.middle), math.tan(down.middle), 1.0]), across


def place_cylinder(
    rays: Array, width_m: float, pixel: float, up: Array
) -> tuple[Array, Extent] | Refusal:
    """Place an upright cylinder by the two upright planes that touch it, and by its rims."""
    sight = rays.mean(axis=0)
    sight /= np.linalg.norm(sight)
    slant = math.acos(min(abs(float(up @ sight)), 1.0))
    spread = math.acos(float((rays @ sight / np.linalg.norm(rays, axis=1)).min()))
    if slant < 1.2 * spread:
        # from above, its top is a disc that faces the camera, and its sides tell nothing
        return place_flat(rays, width_m, pixel)
    ahead = sight - up * float(up @ sight)
    ahead /= np.linalg.norm(ahead)
    aside = np.cross(ahead, up)
    level = np.hypot(rays @ ahead, rays @ aside)
    bearing = np.arctan2(rays @ aside, rays @ ahead)
    elevation = np.arctan2(rays @ up, level)
    unit = pixel / float(level.mean())
    across = extent(bearing, elevation, unit)
    along = extent(elevation, bearing, unit)
    if across.size < LEAST_PX * unit:
        return Refusal.THIN
    radius = width_m / 2
    rho = radius / math.sin(across.size / 2)
    # of a rim below the lens the near side looks lowest and the far side highest
    low = math.tan(along.low) * (rho - math.copysign(radius, -along.low))
    high = math.tan(along.high) * (rho - math.copysign(radius, along.high))
    direction = ahead * math.cos(across.middle) + aside * math.sin(across.middle)
    p_camera: Array = rho * direction + up * (low + high) / 2
    return p_camera, across

"""The paper's inverse kinematics (8)-(15) in closed form, with every branch, for many points.

As printed, the formulas lose branches and quadrants. Here arctan of a ratio is atan2, both signs
of s3 are solutions, and so are the two that reach the target backwards, with theta1 turned by pi.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import InputError
from arm3dof.model.dh import DhGeometry
from arm3dof.model.reach import POSITION_TOLERANCE, Singularity
from arm3dof.model.turns import TURN
from arm3dof.state import Array

BRANCHES = ("front/elbow-up", "front/elbow-down", "back/elbow-up", "back/elbow-down")
"""The four branches, in the order in which they are preferred."""

CHUNK = 8192
"""Points solved at a time: the temporaries stay inside the second-level cache."""


class PointSolutions(NamedTuple):
    """Solutions for many points; joint limits play no part.

    Attributes:
        q: joint positions in (-pi, pi], one row for each of ``BRANCHES``, shape (n, 4, 3) [rad];
            NaN where there is no solution.
        exists: whether the arm's lengths reach the point, shape (n,).
    """

    q: Array
    exists: NDArray[np.bool_]


def solve_points(geometry: DhGeometry, points: ArrayLike) -> PointSolutions:
    """Return all four branches of (8)-(15) for each point.

    Branches that meet at a singularity are given twice. Where the first joint is free (the point
    is on its axis) it is pointed wherever rounding points it; where the second one is free too,
    so is that. ``inverse_kinematics`` tells these cases apart.

    Args:
        geometry: the arm.
        points: where the tool shall be, in the base frame, shape (n, 3) [m]; a point that is not
            finite has no solution.

    Raises:
        InputError: ``points`` has another shape.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points has shape {points.shape}; give shape (n, 3)")
    count = len(points)
    q, exists = np.empty((count, 4, 3)), np.empty(count, dtype=np.bool_)
    rotation = geometry.transform_base_dh[:3, :3]
    origin = geometry.transform_base_dh[:3, 3]
    theta = np.empty((4, 3, min(count, CHUNK)))
    with np.errstate(invalid="ignore", over="ignore"):
        for start in range(0, count, CHUNK):
            rows = slice(start, min(start + CHUNK, count))
            p_dh = rotation.T @ (points[rows] - origin).T
            block = theta[:, :, : p_dh.shape[1]]
            exists[rows] = _branch_angles(geometry.a2, geometry.a3, p_dh, block)
            _into_half_turn(block, geometry)
            q[rows] = block.transpose(2, 0, 1)
    return PointSolutions(q, exists)


def _branch_angles(a2: float, a3: float, p_dh: Array, theta: Array) -> NDArray[np.bool_]:
    """Write the DH angles of all branches into ``theta``.

    With N = (a2 + a3)^2 - p^2 and D = p^2 - (a2 - a3)^2, (9) says c3 = (D - N) / (D + N), so that
    (10) is theta3 = 2 atan2(sqrt N, sqrt D): exact where c3 = +-1 and the printed form cancels.
    (15) is scaled by 2 a2: a3 s3 becomes sqrt(N D), and a2 + a3 c3 becomes p^2 + a2^2 - a3^2.

    Args:
        a2: upper arm [m].
        a3: forearm [m].
        p_dh: points in DH frame 0, shape (3, m) [m]; those out of reach are overwritten.
        theta: result, shape (4, 3, m) [rad].

    Returns:
        Whether each point is in reach, shape (m,).
    """
    x, y, z = p_dh
    square = x * x + y * y + z * z
    exists = _in_reach(a2, a3, square)
    square[~exists] = np.nan
    p_dh[:, ~exists] = np.nan
    outer, inner = _borders(a2, a3)
    n, d = outer * outer - square, square - inner * inner
    n[n <= 2.0 * outer * POSITION_TOLERANCE] = 0.0
    d[d <= (2.0 * inner + POSITION_TOLERANCE) * POSITION_TOLERANCE] = 0.0
    r = np.sqrt(x * x + y * y)
    along, across = square + (a2 * a2 - a3 * a3), np.sqrt(n * d)
    r_along, r_across, z_along, z_across = r * along, r * across, z * along, z * across

    theta1, theta3 = theta[0, 0], theta[1, 2]
    np.arctan2(y, x, out=theta1)  # (11)
    np.arctan2(np.sqrt(n), np.sqrt(d), out=theta3)  # (10), elbow down
    theta3 *= 2.0
    np.arctan2(z_along + r_across, r_along - z_across, out=theta[0, 1])  # (15), s3 < 0
    np.arctan2(z_along - r_across, r_along + z_across, out=theta[1, 1])  # (15), s3 > 0
    theta[1, 0] = theta1
    np.add(theta1, np.pi, out=theta[2:, 0])
    np.subtract(np.pi, theta[:2, 1], out=theta[2:, 1])
    np.negative(theta3, out=theta[0, 2])
    theta[2, 2], theta[3, 2] = theta3, theta[0, 2]
    return exists


def _into_half_turn(theta: Array, geometry: DhGeometry) -> None:
    """Turn DH angles into joint positions in (-pi, pi], in place, shape (4, 3, m)."""
    for joint in range(3):
        q = theta[:, joint]
        q -= geometry.offset[joint]
        q *= geometry.sign[joint]
        q -= TURN * np.ceil(q / TURN - 0.5)


def _borders(a2: float, a3: float) -> tuple[float, float]:
    """Return the greatest and the smallest distance from shoulder to tool [m]."""
    return a2 + a3, abs(a2 - a3)


def _in_reach(a2: float, a3: float, square: Array) -> NDArray[np.bool_]:
    """Return whether points at these squared distances [m^2] from the shoulder are in reach."""
    outer, inner = _borders(a2, a3)
    inside = np.square(max(0.0, inner - POSITION_TOLERANCE))
    return np.asarray((square <= np.square(outer + POSITION_TOLERANCE)) & (square >= inside))


def to_dh_frame(geometry: DhGeometry, p: Array) -> Array:
    """Return a point of the base frame in DH frame 0, shape (3,) [m]."""
    transform = geometry.transform_base_dh
    return np.asarray(transform[:3, :3].T @ (p - transform[:3, 3]))


def singularities(geometry: DhGeometry, p: Array) -> tuple[Singularity, ...]:
    """Return what is special about a point that is in reach.

    Args:
        geometry: the arm.
        p: the point in the base frame, shape (3,) [m].
    """
    p_dh = to_dh_frame(geometry, p)
    outer, inner = _borders(geometry.a2, geometry.a3)
    distance = math.hypot(*p_dh)
    found = {
        Singularity.BASE_FREE: math.hypot(p_dh[0], p_dh[1]) <= POSITION_TOLERANCE,
        Singularity.SHOULDER_FREE: distance <= POSITION_TOLERANCE,
        Singularity.STRETCHED: distance >= outer - POSITION_TOLERANCE,
        Singularity.FOLDED: distance <= inner + POSITION_TOLERANCE,
    }
    return tuple(kind for kind, holds in found.items() if holds)

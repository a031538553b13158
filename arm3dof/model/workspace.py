"""The nearest point that the paper's arm reaches inside its joint limits, exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from arm3dof.model.dh import DhGeometry, position
from arm3dof.model.planar_ik import to_dh_frame
from arm3dof.model.robot import Limits
from arm3dof.model.turns import closest_inside, into_limits
from arm3dof.state import Array


class Range(NamedTuple):
    """Limits of one DH angle [rad]."""

    low: float
    high: float

    def closest(self, angle: float) -> float:
        """Return the angle inside that points most nearly the same way [rad]."""
        return closest_inside(angle, self.low, self.high)

    def ends(self) -> tuple[float, ...]:
        """Return the ends that are finite [rad]."""
        return tuple(end for end in self if math.isfinite(end))


def nearest_configuration(
    geometry: DhGeometry, limits: Limits, p: Array, reference: Array
) -> Array:
    """Return joint positions inside the limits whose tool point is nearest to a target.

    With theta1 at an angle delta from the target, a tool at (x, z) in the arm's plane is at the
    squared distance |p|^2 + |(x, z)|^2 - 2 (x r cos delta + z p_z). So the best delta is the one
    nearest to 0 (x > 0) or to pi (x < 0), whatever theta2 and theta3 are. In the plane, the
    nearest point of a region that does not hold the target lies on its border, and that is made
    of arcs: theta3 at a limit, stretched or folded; or theta2 at a limit.

    Args:
        geometry: the arm.
        limits: its joint limits.
        p: target in the base frame, shape (3,) [m].
        reference: of equal whole turns, the nearest to these are returned, shape (3,) [rad].
    """
    x, y, z = (float(value) for value in to_dh_frame(geometry, p))
    r, azimuth = math.hypot(x, y), math.atan2(y, x)
    base, shoulder, elbow = _dh_ranges(geometry, limits)
    candidates = []
    for towards in (azimuth, azimuth + math.pi):
        theta1 = base.closest(towards)
        along = r * math.cos(theta1 - azimuth)
        candidates += [
            (theta1, theta2, theta3)
            for theta2, theta3 in _in_plane(geometry, shoulder, elbow, along, z)
        ]
    theta = np.array(candidates)
    tools = position(theta, geometry.a2, geometry.a3)
    q = geometry.from_dh(theta[_nearest_row(tools, np.array([x, y, z]))])
    q = into_limits(q, limits.q_min, limits.q_max, reference)
    return np.clip(q, limits.q_min, limits.q_max)


def _in_plane(
    geometry: DhGeometry, shoulder: Range, elbow: Range, x: float, z: float
) -> Iterator[tuple[float, float]]:
    """Yield angles (theta2, theta3) inside the limits, the best ones for (x, z) among them."""
    a2, a3 = geometry.a2, geometry.a3
    direction = math.atan2(z, x)
    bends = {*elbow.ends(), elbow.closest(0.0), elbow.closest(math.pi)}
    distance = math.hypot(x, z)
    if abs(a2 - a3) < distance < a2 + a3:
        c3 = ((distance - a2) * (distance + a2) - a3 * a3) / (2.0 * a2 * a3)
        bend = math.acos(max(-1.0, min(1.0, c3)))
        bends |= {elbow.closest(bend), elbow.closest(-bend)}
    for theta3 in bends:
        slant = math.atan2(a3 * math.sin(theta3), a2 + a3 * math.cos(theta3))
        yield shoulder.closest(direction - slant), theta3
    for theta2 in shoulder.ends():
        forearm = math.atan2(z - a2 * math.sin(theta2), x - a2 * math.cos(theta2))
        yield theta2, elbow.closest(forearm - theta2)


def _nearest_row(points: Array, target: Array) -> int:
    """Return which point is nearest, exact for very near and for very far targets."""
    best = 0
    for row, point in enumerate(points):
        if (point - points[best]) @ (0.5 * (point + points[best]) - target) < 0.0:
            best = row
    return best


def _dh_ranges(geometry: DhGeometry, limits: Limits) -> tuple[Range, Range, Range]:
    """Return the limits of the DH angles."""
    ends = geometry.to_dh(np.stack([limits.q_min, limits.q_max]))
    low, high = np.sort(ends, axis=0).tolist()
    return Range(low[0], high[0]), Range(low[1], high[1]), Range(low[2], high[2])

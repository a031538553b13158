"""Angles that mean the same pose: whole turns, and which of them lies inside the limits."""

from __future__ import annotations

import numpy as np

from arm3dof.state import Array

TURN = 2.0 * np.pi
ROUNDING = 1e-6
"""An angle this far outside a limit may be there by rounding [rad]."""


def into_limits(q: Array, low: Array, high: Array, reference: Array) -> Array:
    """Move angles by whole turns: into the limits, and there the nearest to a reference.

    An angle that no turn brings inside comes out within half a turn of the reference, or within
    ``ROUNDING`` of a limit where it can.

    Args:
        q: angles, shape (..., n) [rad].
        low: lower limits, shape (n,) [rad].
        high: upper limits, shape (n,) [rad].
        reference: preferred angles, shape (n,) [rad].

    Returns:
        The same poses, shape (..., n) [rad].
    """
    q = q - TURN * np.ceil((q - reference) / TURN - 0.5)
    if ((q >= low) & (q <= high)).all():
        return q
    for margin in (ROUNDING, 0.0):
        bottom, top = low - margin, high + margin
        up = np.maximum(np.ceil((bottom - q) / TURN), 0.0)
        down = np.maximum(np.ceil((q - top) / TURN), 0.0)
        moved = q + TURN * (up - down)
        q = np.where((moved >= bottom) & (moved <= top), moved, q)
    return q


def excess(q: Array, low: Array, high: Array) -> Array:
    """Return how far each angle is outside its limits, the short way round, shape of ``q`` [rad].

    Args:
        q: angles, shape (..., n) [rad].
        low: lower limits, shape (n,) [rad].
        high: upper limits, shape (n,) [rad].
    """
    q = into_limits(q, low, high, np.zeros_like(low))
    outside = (q < low) | (q > high)  # possible only between two finite limits
    below = np.mod(np.where(outside, low - q, 0.0), TURN)
    above = np.mod(np.where(outside, q - high, 0.0), TURN)
    return np.minimum(below, above)


def closest_inside(angle: float, low: float, high: float) -> float:
    """Return the angle between two limits that points most nearly the same way [rad]."""
    bounds = np.array([low]), np.array([high])
    turned = float(into_limits(np.array([angle]), *bounds, np.zeros(1))[0])
    if low <= turned <= high:
        return turned
    return low if (low - turned) % TURN < (turned - high) % TURN else high

"""Bounded least squares for a few unknowns: the dogleg method in rectangular trust regions.

Step for step it is ``scipy.optimize.least_squares`` with ``method="dogbox"`` (Voglis and Lagaris,
2004), but in Python's own numbers, which for a few unknowns are several times as fast as arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from arm3dof.state import Array

_TOLERANCE = 1e-15
"""A search ends when the gradient, or a step as a share of the unknowns, is smaller."""

Region = list[tuple[float, float]]
"""The least and the greatest step of each unknown."""


def least_squares(
    residual: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Array,
    bounds: tuple[Array, Array],
    *,
    least_gain: float,
    most_residuals: int,
) -> tuple[Array, Array]:
    """Return where a residual is least inside bounds, shape (n,), and what is left of it, (m,).

    Args:
        residual: of the unknowns, (n,) -> (m,).
        jacobian: the residual's derivative, (n,) -> (m, n).
        start: where to begin, inside the bounds, shape (n,).
        bounds: the least and the greatest unknowns, shape (n,) each; they may be infinite.
        least_gain: a step that takes a smaller share of the sum of squares is the last one.
        most_residuals: how often the residual may be computed.
    """
    low, high = bounds
    walls = list(zip(low.tolist(), high.tolist(), strict=True))
    x, f = start, residual(start)
    at: list[float] = x.tolist()
    held = [(now == most) - (now == least) for now, (least, most) in zip(at, walls, strict=True)]
    cost, radius = 0.5 * float(f.dot(f)), max(map(abs, at)) or 1.0
    computed, done = 1, False
    while True:
        slope = jacobian(x)
        gradient = slope.T.dot(f)
        pull = gradient.tolist()
        free = [i for i, side in enumerate(held) if not side * pull[i] < 0.0]
        if len(free) < len(at):
            slope, gradient = slope[:, free], gradient[free]
            pull = gradient.tolist()
        if done or computed >= most_residuals or max(map(abs, pull), default=0.0) < _TOLERANCE:
            return x, f
        newton = np.linalg.lstsq(slope, -f, rcond=-1)[0].tolist()
        along = slope.dot(-gradient)
        bend, descent = 0.5 * float(along.dot(along)), float(gradient.dot(-gradient))
        gain = -1.0
        while gain <= 0.0 and computed < most_residuals and not done:
            rooms = [(walls[i][0] - at[i], walls[i][1] - at[i]) for i in free]
            region = [(max(least, -radius), min(most, radius)) for least, most in rooms]
            step, hits = _dogleg(newton, pull, bend, descent, region)
            moved = np.zeros(x.size)
            moved[free] = step
            ahead = slope.dot(moved[free])
            foreseen = -(0.5 * float(ahead.dot(ahead)) + float(moved[free].dot(gradient)))
            x_new = np.clip(x + moved, low, high)
            f_new = residual(x_new)
            computed += 1
            cost_new = 0.5 * float(f_new.dot(f_new))
            gain = cost - cost_new
            share = gain / foreseen if foreseen > 0.0 else float(foreseen == gain == 0.0)
            if share < 0.25:
                radius = 0.25 * max(map(abs, step))
            elif share > 0.75 and _at_radius(hits, region, radius):
                radius *= 2.0
            size = math.hypot(*step)
            short = size < _TOLERANCE * (_TOLERANCE + math.hypot(*at))
            done = short or (gain < least_gain * cost and share > 0.25)
        if gain <= 0.0:
            return x, f
        for i, hit, room, reach in zip(free, hits, rooms, region, strict=True):
            held[i] = hit if hit and room[hit > 0] == reach[hit > 0] else 0
        at = x_new.tolist()
        for i, side in enumerate(held):
            if side:
                at[i] = walls[i][side > 0]
        x, f, cost = np.array(at), f_new, cost_new


def _dogleg(
    newton: list[float], pull: list[float], bend: float, descent: float, region: Region
) -> tuple[list[float], list[int]]:
    """Return the dogleg step inside a region, and at which of its sides it ends (-1, 0, 1)."""
    none = [0] * len(newton)
    if all(least <= value <= most for value, (least, most) in zip(newton, region, strict=True)):
        return newton, none
    down = [-value for value in pull]
    to_edge, _ = _to_edge([0.0] * len(newton), down, region)
    best = -0.5 * descent / bend if bend != 0.0 else math.inf
    candidates = [0.0, to_edge, best] if 0.0 < best < to_edge else [0.0, to_edge]
    length = min(candidates, key=lambda t: t * (bend * t + descent))
    cauchy = [-length * value for value in pull]
    rest = [value - start for value, start in zip(newton, cauchy, strict=True)]
    share, hits = _to_edge(cauchy, rest, region)
    return [start + share * value for start, value in zip(cauchy, rest, strict=True)], hits


def _to_edge(start: list[float], way: list[float], region: Region) -> tuple[float, list[int]]:
    """Return how far a way leads until it leaves a region, and through which of its sides."""
    shares = [
        max((least - first) / along, (most - first) / along) if along else math.inf
        for first, along, (least, most) in zip(start, way, region, strict=True)
    ]
    nearest = min(shares)
    signs = [(along > 0.0) - (along < 0.0) for along in way]
    return nearest, [
        sign if share == nearest else 0 for sign, share in zip(signs, shares, strict=True)
    ]


def _at_radius(hits: list[int], region: Region, radius: float) -> bool:
    """Whether a step ends at the trust region's own edge."""
    return any(
        hit and abs(reach[hit > 0]) == radius for hit, reach in zip(hits, region, strict=True)
    )

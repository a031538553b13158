"""Quadratic programs with nothing but bounds, solved step by step by the primal active set method.

All variables begin at zero. The one whose bound costs most is moved, and those that are inside
their bounds follow so that their own conditions stay met, until it has reached its best place and
joins them, or one of them, or it itself, meets a bound (Nocedal and Wright 2006, section 16.5). The
Hessian of those inside stays regular, even where that of all is singular: a variable that depends
on them moves without resistance, and one of them has to leave first. If none does the program is
the dual of one that no point satisfies.

The same problem has the same answer to the last bit, whatever was solved before. ProxQP's answer
depends on where its memory lies, and where rows are nearly dependent, so does its success.
"""

from __future__ import annotations

import numpy as np

from arm3dof.control.qp import QpStatus
from arm3dof.state import Array

_LEAST_CURVATURE = 1e-11  # less, of a diagonal of about 1, is a dependent row
_ENDLESS = 1e15  # a step this long meets no bound


def solve_by_active_set(
    H: Array, g: Array, u: Array, tolerance: float, most_steps: int
) -> tuple[Array, QpStatus]:
    """Minimise 1/2 x' H x + g' x subject to 0 <= x <= u.

    Args:
        H: Hessian, positive semidefinite, with a diagonal of about 1, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        tolerance: gradient up to which a bound costs nothing.
        most_steps: cap on the steps; each adds or takes a variable to or from those inside.

    Returns:
        The last point, inside its bounds, and how it came about.
    """
    x, inside = np.zeros_like(g), np.zeros(g.size, dtype=np.bool_)
    joining, sign = -1, 0.0  # which variable is being moved, and which way
    for _ in range(most_steps):
        gradient = H @ x + g
        if joining < 0:
            cost = np.where(x > 0.0, gradient, -gradient)
            cost[inside | (u <= 0.0)] = 0.0
            joining = int(cost.argmax())
            if cost[joining] <= tolerance:
                return x, QpStatus.SOLVED
            sign = -1.0 if x[joining] > 0.0 else 1.0
        k = inside.nonzero()[0]
        way = np.zeros_like(g)
        way[joining] = sign
        try:
            way[k] = np.linalg.solve(H[k[:, np.newaxis], k], -H[k] @ way)
        except np.linalg.LinAlgError:  # rounding made those inside dependent after all
            break
        curvature, descent = sign * float(H[joining] @ way), -sign * float(gradient[joining])
        to_best = max(descent, 0.0) / curvature if curvature > _LEAST_CURVATURE else np.inf
        to_bound = _steps_to_bounds(x, way, u)
        first = int(to_bound.argmin())
        step = min(to_best, float(to_bound[first]))
        if not step < _ENDLESS:
            return x, QpStatus.UNBOUNDED
        x = np.minimum(np.maximum(x + step * way, 0.0), u)
        if to_best <= to_bound[first]:
            inside[joining], joining = True, -1
        else:
            x[first] = u[first] if way[first] > 0 else 0.0
            inside[first] = False
            if first == joining:
                joining = -1
    return x, QpStatus.ITERATION_LIMIT


def _steps_to_bounds(x: Array, way: Array, u: Array) -> Array:
    """Return how far each variable may go before it meets a bound; endless where it rests."""
    room = np.where(way > 0.0, u - x, x)
    steps = np.full_like(x, np.inf)
    return np.divide(room, np.abs(way), out=steps, where=way != 0.0)

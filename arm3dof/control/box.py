"""Quadratic programs with nothing but bounds: guessed well and proved, or solved step by step.

A guess of which variables are inside their bounds gives a point by one linear system. It is made
better by the primal-dual active set method (Hintermueller, Ito and Kunisch 2003). Where the sets
settle the point keeps its bounds and its multipliers have the right signs by construction, so the
gradient alone has to be looked at. Where they do not, the primal active set method takes over, and
what it cannot settle either is left to ProxQP.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.active_set import solve_by_active_set
from arm3dof.control.qp import QpSettings, QpSolution, QpStatus, broken, solve_once
from arm3dof.state import Array

_SAME = 1e-5  # relative difference up to which a solution is made exact
_ROUNDS = 8  # in which a guess is made better
_ABSURD = 1e8  # a larger guess comes from rows that are nearly dependent


class _Point(NamedTuple):
    """A point that may be the optimum.

    Attributes:
        x: shape (n,).
        z: the bounds' multipliers, shape (n,); positive where the upper one pushes.
        error: largest |H x + g + z|, all that is left to prove; infinite if the sets are not right.
    """

    x: Array
    z: Array
    error: float


def solve_box(
    H: Array, g: Array, u: Array, inside: NDArray[np.bool_], settings: QpSettings
) -> QpSolution:
    """Minimise 1/2 x' H x + g' x subject to 0 <= x <= u.

    Args:
        H: Hessian with a diagonal of about 1, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        inside: which variables are guessed to be inside their bounds, shape (n,).
        settings: accuracy and effort.
    """
    start, n = time.perf_counter(), g.size
    guess = _guess(H, g, u, inside)
    if guess.error <= settings.tolerance:
        return QpSolution(guess.x, guess.z, QpStatus.SOLVED, time.perf_counter() - start)
    if not math.isfinite(float(H.sum()) + float(g.sum())):
        return broken(n, n, start)
    x, status = solve_by_active_set(H, g, u, settings.tolerance, settings.most_steps)
    if status is QpStatus.ITERATION_LIMIT:
        solution = solve_once(H, g, u, guess.x, guess.z, settings)
        x, status = solution.x, solution.status
    if status is QpStatus.NOT_FINITE:
        return broken(n, n, start)
    point = _from_sets(H, g, u, (x > 0.0) & (x < u), x >= u)
    if np.abs(point.x - x).max() <= _SAME * max(float(np.abs(x).max()), 1.0):
        x = point.x  # the sets are known, and with them every digit
    return QpSolution(x, point.z, status, time.perf_counter() - start)


def _guess(H: Array, g: Array, u: Array, inside: NDArray[np.bool_]) -> _Point:
    """Return the point that follows from a guess, made better in rounds.

    If the rounds do not settle the first point is moved into the bounds.
    """
    upper = np.zeros_like(inside)
    first = point = _from_sets(H, g, u, inside, upper)
    for _ in range(_ROUNDS):
        x, z, _ = point
        if x.min() >= 0.0 and z.max() <= 0.0 and (x <= u).all() and not upper.any():
            return point  # the usual case, said shortly
        above, below = x > u, x < 0.0
        new_upper = np.where(inside, above, upper & (z >= 0.0))
        new_inside = np.where(inside, ~(above | below), np.where(upper, z < 0.0, z > 0.0))
        if (new_inside == inside).all() and (new_upper == upper).all():
            return point
        inside, upper = new_inside, new_upper
        point = _from_sets(H, g, u, inside, upper)
    x = np.minimum(np.maximum(first.x, 0.0), u)
    if not x.max() < _ABSURD:
        x = np.zeros_like(g)
    pull = H @ x + g
    z = np.where(x <= 0.0, -np.maximum(pull, 0.0), np.where(x >= u, np.maximum(-pull, 0.0), 0.0))
    return _Point(x, z, math.inf)


def _from_sets(
    H: Array, g: Array, u: Array, inside: NDArray[np.bool_], upper: NDArray[np.bool_]
) -> _Point:
    """Return the point at which known variables are at known bounds.

    Args:
        H: Hessian, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        inside: which variables are inside, shape (n,).
        upper: which are at their upper bounds, shape (n,); the others are at zero.
    """
    try:
        if inside.all():
            x = np.asarray(np.linalg.solve(H, -g))
            return _Point(x, np.zeros_like(g), float(np.abs(H @ x + g).max()))
        x = np.where(upper, u, 0.0)
        k = inside.nonzero()[0]
        x[k] = np.linalg.solve(H[k[:, np.newaxis], k], -g[k] - H[k] @ x)
    except np.linalg.LinAlgError:  # such sets cannot be right
        return _Point(np.zeros_like(g), np.zeros_like(g), math.inf)
    z = -(H @ x + g)
    error = float(np.abs(z[k]).max(initial=0.0))
    z[k] = 0.0
    return _Point(x, z, error)

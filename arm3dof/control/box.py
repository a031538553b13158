"""Quadratic programs with nothing but bounds: guessed well and proved, or solved step by step.

A guess of which variables are inside their bounds gives a point by one linear system. It is made
better by the primal-dual active set method (Hintermueller, Ito and Kunisch 2003). Where its sets
settle the point keeps its bounds and its multipliers have the right signs by construction, so the
gradient alone has to be looked at. Where they do not, the primal active set method takes over, and
what it cannot settle either is left to ProxQP.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import eigenpy
import numpy as np
from numpy.typing import NDArray

from arm3dof.control.active_set import solve_by_active_set
from arm3dof.control.qp import QpSettings, QpSolution, QpStatus, broken, solve_once
from arm3dof.state import Array

_SAME = 1e-5  # relative difference up to which a solution is made exact
_ROUNDS = 8  # in which a guess is made better
_LOWER, _INSIDE, _UPPER = range(3)  # at zero, between the bounds, at the upper bound
_Cholesky = eigenpy.LLT
_OVERFLOW = 1e100  # a larger solution is none, and its square would be infinite
_ABSURD = 1e8  # a larger guess comes from rows that are nearly dependent


class _Point(NamedTuple):
    """A point that may be the optimum.

    Attributes:
        x: shape (n,).
        z: the bounds' multipliers, shape (n,); positive where the upper one pushes.
        error: norm of H x + g + z, all that is left to prove; infinite or NaN if its places
            cannot be right.
    """

    x: Array
    z: Array
    error: float


def solve_box(
    H: Array, g: Array, u: Array, inside: Iterable[bool], settings: QpSettings
) -> QpSolution:
    """Minimise 1/2 x' H x + g' x subject to 0 <= x <= u.

    Args:
        H: Hessian with a diagonal of about 1, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        inside: which variables are guessed to be inside their bounds, n of them.
        settings: accuracy and effort.

    Returns:
        A solution whose ``x`` keeps the bounds, unless it is NaN.
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
    found = zip(x.tolist(), u.tolist(), strict=True)
    places = [_UPPER if at >= most else _INSIDE if at > 0.0 else _LOWER for at, most in found]
    point = _from_places(H, g, u, places)
    if np.abs(point.x - x).max() <= _SAME * max(float(np.abs(x).max()), 1.0):
        x = point.x  # the places are known, and with them every digit
    x = np.minimum(np.maximum(x, 0.0), u)
    return QpSolution(x, point.z, status, time.perf_counter() - start)


def _guess(H: Array, g: Array, u: Array, inside: Iterable[bool]) -> _Point:
    """Return the point that follows from a guess, made better in rounds.

    If the rounds do not settle the first point is moved into the bounds.
    """
    # plain numbers: for as few as there are, faster than arrays
    places, most = [_INSIDE if guessed else _LOWER for guessed in inside], u.tolist()
    first = point = _from_places(H, g, u, places)
    for _ in range(_ROUNDS):
        known = zip((point.x + point.z).tolist(), most, strict=True)
        better = [_UPPER if at > u else _LOWER if at <= 0.0 else _INSIDE for at, u in known]
        if better == places:
            return point
        places = better
        point = _from_places(H, g, u, places)
    x = np.minimum(np.maximum(first.x, 0.0), u)
    if not x.max() < _ABSURD:
        x = np.zeros_like(g)
    pull = H @ x + g
    z = np.where(x <= 0.0, -np.maximum(pull, 0.0), np.where(x >= u, np.maximum(-pull, 0.0), 0.0))
    return _Point(x, z, math.inf)


def _from_places(H: Array, g: Array, u: Array, places: Sequence[int]) -> _Point:
    """Return the point at which known variables are at known bounds.

    Args:
        H: Hessian, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        places: of each variable: inside its bounds, at zero, or at its upper bound.
    """
    n = g.size
    x, pull = np.zeros(n), g
    if _UPPER in places:
        at = [i for i, place in enumerate(places) if place == _UPPER]
        x[at] = u[at]
        pull = H.dot(x) + g
    if _INSIDE not in places:
        return _Point(x, -(H.dot(x) + g), 0.0)  # with H, though x is zero: it may hold NaN
    count = places.count(_INSIDE)
    # as they were guessed those inside come first, and a slice is faster
    k: slice | NDArray[np.intp] = slice(count)
    inner = H[:count, :count]
    if _INSIDE in places[count:]:
        k = np.array([i for i, place in enumerate(places) if place == _INSIDE], dtype=np.intp)
        inner = H.take(k, axis=0).take(k, axis=1)
    try:
        x[k] = _solve(inner, -pull[k])
    except np.linalg.LinAlgError:  # such places cannot be right
        return _Point(np.zeros(n), np.zeros(n), math.inf)
    z = -(H.dot(x) + g)
    error = _norm(z[k])
    z[k] = 0.0
    return _Point(x, z, error)


def _solve(H: Array, right: Array) -> Array:
    """Return H^-1 right of a positive definite H; less than half the time of numpy's ``solve``.

    What is returned of another H solves nothing, if anything is returned.

    Raises:
        numpy.linalg.LinAlgError: H is so nearly singular that numbers overflow.
    """
    x = np.asarray(_Cholesky(H).solve(right).ravel())  # of one row it makes a matrix
    numbers = x.tolist()
    if not (min(numbers) > -_OVERFLOW and max(numbers) < _OVERFLOW):
        raise np.linalg.LinAlgError("singular")
    return x


def _norm(values: Array) -> float:
    return math.sqrt(values.dot(values))

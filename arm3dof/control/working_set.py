"""The limits that are held against a control step's optimum, out of all that there are."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.bounds import RATE, TORQUE, Bounds
from arm3dof.control.program import Program
from arm3dof.state import Array


class WorkingSet(NamedTuple):
    """Some limits of a program as rows C w <= b, each the tangent of what it limits.

    Attributes:
        limits: which limits, by their places in ``Bounds.sides``, shape (k,).
        C: shape (k, n).
        b: shape (k,).
        price: most that a unit of violation may cost, shape (k,).
        which: what is limited, by its place among the flattened values, shape (k,).
        sign: 1 for an upper limit, -1 for a lower one, shape (k,).
        sides: the limits themselves, lower ones with their signs turned, shape (k,).
    """

    limits: NDArray[np.intp]
    C: Array
    b: Array
    price: Array
    which: NDArray[np.intp]
    sign: Array
    sides: Array

    @staticmethod
    def of(program: Program, bounds: Bounds, limits: NDArray[np.intp], w: Array) -> WorkingSet:
        """Return some limits with tangents that touch at w."""
        count = bounds.high.size
        which = limits % count
        slopes, offsets = _tangents(program, bounds, which, w)
        sign, sides, price = _signs(count)[limits], bounds.sides[limits], bounds.prices[limits]
        C = sign[:, np.newaxis] * slopes
        return WorkingSet(limits, C, sides - sign * offsets, price, which, sign, sides)

    def joined(self, other: WorkingSet) -> WorkingSet:
        """Return the limits of both."""
        return WorkingSet(*(np.concatenate(parts) for parts in zip(self, other, strict=True)))


def limited(program: Program, bounds: Bounds, w: Array) -> Array:
    """Return all that is limited, shape (kinds, N, nv): torque, position, velocity, torque rate."""
    values = program.values(w)
    if len(bounds.high) > RATE:
        torque = values[TORQUE]
        change = np.diff(torque, axis=0, prepend=bounds.last_torque[np.newaxis])
        values = np.concatenate([values, change[np.newaxis]])
    return values


@lru_cache(maxsize=16)
def _signs(count: int) -> Array:
    """Return 1 for all upper limits, and then -1 for all lower ones, shape (2 count,)."""
    return np.repeat([1.0, -1.0], count)


def _tangents(
    program: Program, bounds: Bounds, which: NDArray[np.intp], w: Array
) -> tuple[Array, Array]:
    """Return slopes and offsets of what is limited, changes of torque included."""
    if len(bounds.high) <= RATE:
        return program.tangents(which, w)
    nv, kind = bounds.last_torque.size, bounds.high[TORQUE].size
    is_rate = which >= RATE * kind
    own = np.where(is_rate, which - RATE * kind, which)
    slopes, offsets = program.tangents(own, w)
    at = is_rate.nonzero()[0]
    later = at[own[at] >= nv]
    slopes_before, offsets_before = program.tangents(own[later] - nv, w)
    slopes[later] -= slopes_before
    offsets[later] -= offsets_before
    first = at[own[at] < nv]
    offsets[first] -= bounds.last_torque[own[first]]
    return slopes, offsets

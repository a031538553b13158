"""The limits that are held against a control step's optimum, out of all that there are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.bounds import RATE, TORQUE, Bounds
from arm3dof.control.program import Program, Tangents
from arm3dof.control.qp import UNBOUNDED
from arm3dof.state import Array


class WorkingSet(NamedTuple):
    """Some limits of a program as rows C w <= b, each the tangent of what it limits.

    A row is in units of the tangent's size (``Tangents``), so C H^-1 C' has a diagonal of one.

    Attributes:
        limits: which limits, by their places in ``Bounds.sides``, shape (k,).
        C: shape (k, n).
        b: shape (k,).
        through: C H^-1, shape (k, n).
        price: most that a unit of violation may cost, shape (k,).
        size: shape (k,).
        sides: the limits themselves, lower ones with their signs turned, shape (k,).
        exact: whether the tangents are what is limited, everywhere.
    """

    limits: NDArray[np.intp]
    C: Array
    b: Array
    through: Array
    price: Array
    size: Array
    sides: Array
    exact: bool

    @staticmethod
    def of(program: Program, bounds: Bounds, limits: NDArray[np.intp], w: Array) -> WorkingSet:
        """Return some limits with tangents that touch at w."""
        C, offsets, through, size, exact = _tangents(program, bounds, limits, w)
        sides = bounds.sides.take(limits)
        price = np.minimum(bounds.prices.take(limits) * size, UNBOUNDED)
        return WorkingSet(limits, C, sides / size - offsets, through, price, size, sides, exact)

    def joined(self, other: WorkingSet) -> WorkingSet:
        """Return the limits of both."""
        parts = [np.concatenate(pair) for pair in zip(self[:-1], other[:-1], strict=True)]
        return WorkingSet._make([*parts, self.exact and other.exact])

    def affine(self) -> tuple[Array, Array]:
        """Return slopes and values at w = 0 of the tangents, in the units of what is limited."""
        return self.size[:, np.newaxis] * self.C, self.sides - self.size * self.b

    def slack(self, w: Array) -> Array:
        """Return how far the tangents at w are from the limits, shape (k,)."""
        return np.asarray(self.size * (self.b - self.C.dot(w)))


def limited(program: Program, bounds: Bounds, w: Array) -> Array:
    """Return all that is limited, shape (kinds, N, nv): torque, position, velocity, torque rate."""
    values = program.values(w)
    if len(bounds.tolerance) > RATE:
        torque = values[TORQUE]
        change = np.diff(torque, axis=0, prepend=bounds.last_torque[np.newaxis])
        values = np.concatenate([values, change[np.newaxis]])
    return values


def _tangents(program: Program, bounds: Bounds, limits: NDArray[np.intp], w: Array) -> Tangents:
    """Return the tangents of what is limited, changes of torque included."""
    if len(bounds.tolerance) <= RATE:
        return program.tangents(limits, w)
    nv, count, kind = bounds.last_torque.size, bounds.tolerance.size, bounds.tolerance[0].size
    lower, which = np.divmod(limits, count)
    is_rate = which >= RATE * kind
    own = np.where(is_rate, which - RATE * kind, which)
    first_lower = lower * (count - kind)  # the program knows nothing of changes
    slopes, offsets = _natural(program.tangents(first_lower + own, w))
    at = is_rate.nonzero()[0]
    later = at[own[at] >= nv]
    slopes_before, offsets_before = _natural(program.tangents((first_lower + own)[later] - nv, w))
    slopes[later] -= slopes_before
    offsets[later] -= offsets_before
    first = at[own[at] < nv]
    offsets[first] -= (1 - 2 * lower[first]) * bounds.last_torque[own[first]]
    return Tangents.scaled(slopes, offsets, program, exact=False)


def _natural(tangents: Tangents) -> tuple[Array, Array]:
    """Return slopes and offsets in the units of the values."""
    size = tangents.size
    return size[:, np.newaxis] * tangents.slopes, size * tangents.offsets

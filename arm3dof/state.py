"""Frozen values that every layer passes around."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import InputError

Array = NDArray[np.float64]


def frozen_array(values: ArrayLike, *shape: int | None, name: str) -> Array:
    """Copy ``values`` into a read-only float array of the given shape.

    Args:
        values: anything that numpy turns into floats.
        shape: expected length of each axis; ``None`` leaves that axis free.
        name: what the message calls the array.

    Raises:
        InputError: the values are not numbers, or have another shape.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {values!r}; give an array of numbers") from None
    if array.shape != shape and not _fits(array.shape, shape):
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise InputError(f"{name} has shape {array.shape}; give shape {wanted}")
    array.setflags(write=False)
    return array


def _fits(have: tuple[int, ...], want: tuple[int | None, ...]) -> bool:
    return len(have) == len(want) and all(
        b is None or a == b for a, b in zip(have, want, strict=True)
    )


def _finite(vector: Array) -> bool:
    """Whether all numbers of a vector are finite; plain numbers, for they are few."""
    return all(map(math.isfinite, vector.tolist()))


def finite_vector(values: ArrayLike, size: int, name: str) -> Array:
    """Copy an argument into a read-only vector of finite numbers, shape (size,).

    Raises:
        InputError: it has another shape, or holds NaN or infinity.
    """
    vector = frozen_array(values, size, name=name)
    if not _finite(vector):
        raise InputError(f"{name} is {vector.tolist()}; give finite numbers")
    return vector


@dataclass(frozen=True, eq=False)
class JointState:
    """Positions and velocities of all joints at one instant.

    A state may hold NaN: measurements do break, and the controller answers them with a status.

    Attributes:
        t: time [s].
        q: joint positions, shape (nv,) [rad].
        v: joint velocities, shape (nv,) [rad/s].

    Raises:
        InputError: ``q`` is not a vector or ``v`` has another length.
    """

    t: float
    q: Array
    v: Array

    def __post_init__(self) -> None:
        q = frozen_array(self.q, None, name="q")
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "v", frozen_array(self.v, q.size, name="v"))

    @classmethod
    def adopt(cls, t: float, q: Array, v: Array) -> JointState:
        """Return a state that takes over its arrays, unchecked, and freezes them."""
        state = object.__new__(cls)
        q.setflags(write=False)
        v.setflags(write=False)
        own = state.__dict__
        own["t"], own["q"], own["v"] = t, q, v
        return state

    @property
    def is_finite(self) -> bool:
        """Whether every number in the state is finite."""
        return _finite(self.q) and _finite(self.v)

"""Solids that a ray can meet: balls, upright cylinders and boxes.

Points and directions are columns, shape (3, n): each coordinate is contiguous, which is what makes
a picture of 300,000 rays quick in numpy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError
from arm3dof.state import frozen_array

Reals = NDArray[np.floating[Any]]
Faces = NDArray[np.int64]


class Hit(NamedTuple):
    """Where rays first meet a solid.

    Attributes:
        distance: multiple of each ray's direction, shape (n,); ``inf`` where the ray misses.
        face: which smooth face was met, shape (n,).
    """

    distance: Reals
    face: Faces


@dataclass(frozen=True)
class Ball:
    """A sphere.

    Attributes:
        centre: in the base frame [m].
        radius: [m].
        colour: sRGB red, green, blue, 0 to 1.

    Raises:
        InputError: a length or a colour cannot be one.
    """

    centre: tuple[float, float, float]
    radius: float
    colour: tuple[float, float, float]

    def __post_init__(self) -> None:
        _check(self.centre, self.colour, radius=self.radius)

    @property
    def bounding_radius(self) -> float:
        """Radius of a ball about the centre that holds the solid [m]."""
        return self.radius

    @property
    def half_height(self) -> float:
        """Height of the centre above the lowest point [m]."""
        return self.radius

    def meet(self, origins: Reals, directions: Reals) -> Hit:
        """Find where rays meet the ball; origins (3, 1) or (3, n), directions (3, n)."""
        offset = origins - _column(self.centre, directions)
        a = _dots(directions, directions)
        b = _dots(offset, directions)
        distance = _nearest_root(a, b, _dots(offset, offset) - self.radius**2)
        return Hit(distance, np.zeros(len(distance), dtype=np.int64))

    def normals(self, points: Reals, face: Faces) -> Reals:
        """Find the outward normals at points on the surface, shape (3, n)."""
        return (points - _column(self.centre, points)) / self.radius


@dataclass(frozen=True)
class Cylinder:
    """A cylinder that stands upright.

    Attributes:
        centre: middle of its axis, in the base frame [m].
        radius: [m].
        height: [m].
        colour: sRGB red, green, blue, 0 to 1.

    Raises:
        InputError: a length or a colour cannot be one.
    """

    centre: tuple[float, float, float]
    radius: float
    height: float
    colour: tuple[float, float, float]

    def __post_init__(self) -> None:
        _check(self.centre, self.colour, radius=self.radius, height=self.height)

    @property
    def bounding_radius(self) -> float:
        """Radius of a ball about the centre that holds the solid [m]."""
        return math.hypot(self.radius, self.height / 2)

    @property
    def half_height(self) -> float:
        """Height of the centre above the lowest point [m]."""
        return self.height / 2

    def meet(self, origins: Reals, directions: Reals) -> Hit:
        """Find where rays meet the cylinder; origins (3, 1) or (3, n), directions (3, n)."""
        offset = origins - _column(self.centre, directions)
        a = np.maximum(_dots(directions[:2], directions[:2]), 1e-30)
        b = _dots(offset[:2], directions[:2])
        side = _nearest_root(a, b, _dots(offset[:2], offset[:2]) - self.radius**2)
        half = self.height / 2
        reach = np.where(np.isfinite(side), side, 0)
        side = np.where(np.abs(offset[2] + reach * directions[2]) <= half, side, np.inf)
        fall = np.where(np.abs(directions[2]) < 1e-12, 1e-12, directions[2])
        cap = (np.where(fall < 0, half, -half) - offset[2]) / fall
        x, y = offset[0] + cap * directions[0], offset[1] + cap * directions[1]
        cap = np.where((cap > 0) & (x * x + y * y <= self.radius**2), cap, np.inf)
        face = np.where(cap < side, np.where(fall < 0, 1, 2), 0)
        return Hit(np.minimum(side, cap).astype(directions.dtype), face)

    def normals(self, points: Reals, face: Faces) -> Reals:
        """Find the outward normals at points on the surface, shape (3, n)."""
        result = (points - _column(self.centre, points)) / self.radius
        result[:2] *= face == 0
        result[2] = np.where(face == 1, 1, np.where(face == 2, -1, 0))
        return result


@dataclass(frozen=True)
class Box:
    """A box that stands upright.

    Attributes:
        centre: in the base frame [m].
        size: full lengths along its own x, y and z [m].
        yaw: turn about the vertical [rad].
        colour: sRGB red, green, blue, 0 to 1.

    Raises:
        InputError: a length or a colour cannot be one.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float
    colour: tuple[float, float, float]

    def __post_init__(self) -> None:
        length, width, height = frozen_array(self.size, 3, name="size").tolist()
        _check(self.centre, self.colour, length=length, width=width, height=height)

    @property
    def bounding_radius(self) -> float:
        """Radius of a ball about the centre that holds the solid [m]."""
        return math.hypot(*self.size) / 2

    @property
    def half_height(self) -> float:
        """Height of the centre above the lowest point [m]."""
        return self.size[2] / 2

    def meet(self, origins: Reals, directions: Reals) -> Hit:
        """Find where rays meet the box; origins (3, 1) or (3, n), directions (3, n)."""
        turn = self._rotation(directions).T
        offset = turn @ (origins - _column(self.centre, directions))
        towards = turn @ directions
        towards = np.where(np.abs(towards) < 1e-12, 1e-12, towards)
        half = np.copysign(_column(self.size, directions) / 2, towards)
        first = (-half - offset) / towards
        enter = first.max(axis=0)
        leave = ((half - offset) / towards).min(axis=0)
        axis = first.argmax(axis=0)
        back = np.take_along_axis(towards, axis[None], axis=0)[0] < 0
        met = (enter > 0) & (enter <= leave)
        return Hit(np.where(met, enter, np.inf).astype(directions.dtype), 2 * axis + back)

    def normals(self, points: Reals, face: Faces) -> Reals:
        """Find the outward normals at points on the surface, shape (3, n)."""
        result = np.zeros_like(points)
        result[face // 2, np.arange(len(face))] = np.where(face % 2, 1, -1)
        return self._rotation(points) @ result

    def _rotation(self, like: Reals) -> Reals:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=like.dtype)


Solid = Ball | Cylinder | Box


def _check(centre: Sequence[float], colour: Sequence[float], **lengths: float) -> None:
    if not np.isfinite(frozen_array(centre, 3, name="centre")).all():
        raise InputError(f"centre is {centre}; give finite metres")
    shares = frozen_array(colour, 3, name="colour")
    if not ((shares >= 0) & (shares <= 1)).all():
        raise InputError(f"colour is {colour}; give red, green and blue from 0 to 1")
    for name, value in lengths.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} is {value}; give metres above 0")


def _column(values: Sequence[float], like: Reals) -> Reals:
    return np.asarray(values, dtype=like.dtype)[:, None]


def _dots(first: Reals, second: Reals) -> Reals:
    result: Reals = first[0] * second[0]
    for one, other in zip(first[1:], second[1:], strict=True):
        result = result + one * other
    return result


def _nearest_root(a: Reals, b: Reals, c: Reals) -> Reals:
    """Return the lesser root of a t^2 + 2 b t + c where it is ahead, else infinity."""
    discriminant = b * b - a * c
    root = (-b - np.sqrt(np.maximum(discriminant, 0))) / a
    nearest: Reals = np.where((discriminant > 0) & (root > 1e-9), root, np.inf).astype(a.dtype)
    return nearest

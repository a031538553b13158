"""Shapes of one material each, and the sum of their inertias."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vec = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """What a part is made of: colour (red, green, blue, 0 to 1) and density [kg/m^3]."""

    name: str
    rgb: Vec
    density: float


@dataclass(frozen=True)
class Box:
    """A box with edges along the frame's axes; sizes in mm."""

    size: Vec

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return math.prod(self.size) * 1e-9

    def inertia_per_mass(self) -> Array:
        """Principal moments about the centroid over the mass, shape (3,) [m^2]."""
        squares = (np.array(self.size) * 1e-3) ** 2
        return (squares.sum() - squares) / 12.0


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder about one of the frame's axes; sizes in mm."""

    radius: float
    length: float
    axis: str = "z"

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return math.pi * self.radius**2 * self.length * 1e-9

    def inertia_per_mass(self) -> Array:
        """Principal moments about the centroid over the mass, shape (3,) [m^2]."""
        radius, length = self.radius * 1e-3, self.length * 1e-3
        moments = np.full(3, radius**2 / 4.0 + length**2 / 12.0)
        moments["xyz".index(self.axis)] = radius**2 / 2.0
        return moments


@dataclass(frozen=True)
class Part:
    """A shape of one material at a place in its link's frame.

    Attributes:
        name: what it is.
        shape: its form; box edges and cylinder axes lie along the link's axes.
        at: place of its centre [mm].
        material: what it is made of.
        mass: mass [kg] where it is known otherwise; else density times volume.
        drawn: whether it is seen (a servo weighs as one box but is drawn as several).
    """

    name: str
    shape: Box | Cylinder
    at: Vec
    material: Material
    mass: float | None = None
    drawn: bool = True

    @property
    def weight(self) -> float:
        """Mass [kg]."""
        return self.material.density * self.shape.volume if self.mass is None else self.mass


@dataclass(frozen=True)
class Body:
    """Inertia of a link: mass [kg], centroid (3,) [m], tensor (3, 3) about it [kg m^2]."""

    mass: float
    centroid: Array
    tensor: Array


def sum_parts(parts: Iterable[Part]) -> Body:
    """Add parts up to one rigid body by the parallel-axis theorem."""
    parts = tuple(parts)
    masses = np.array([part.weight for part in parts])
    places = np.array([part.at for part in parts]) * 1e-3
    mass = float(masses.sum())
    centroid = masses @ places / mass
    tensor = np.zeros((3, 3))
    for part, m, r in zip(parts, masses, places - centroid, strict=True):
        tensor += m * (np.diag(part.shape.inertia_per_mass()) + (r @ r) * np.eye(3))
        tensor -= m * np.outer(r, r)
    return Body(mass, centroid, tensor)


def vec(values: Array) -> Vec:
    """Return three plain floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z

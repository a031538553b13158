"""What an arm carries: a point of mass that is fixed to its tool."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.state import finite_vector


@dataclass(frozen=True)
class Payload:
    """A point mass that moves with the tool frame.

    Attributes:
        mass: [kg].
        com: where it is in the tool frame [m].

    Raises:
        InputError: the mass is negative or not finite, or ``com`` is not three finite numbers.
    """

    mass: float
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        mass = self.mass
        real = isinstance(mass, Real) and not isinstance(mass, bool)
        if not (real and math.isfinite(mass) and mass >= 0):
            raise InputError(f"the payload's mass is {mass!r}; give 0 or more kilograms")
        object.__setattr__(self, "mass", float(mass))
        object.__setattr__(self, "com", centre_of_mass(self.com))

    def attach(self, model: pin.Model, frame: int) -> pin.Model:
        """Return a copy of a model whose frame carries the payload.

        Args:
            model: a Pinocchio model; it stays as it is.
            frame: index of the tool frame.
        """
        loaded = pin.Model(model)
        if self.mass > 0:  # adding nothing would still round
            tool = model.frames[frame]
            joint = tool.parentJoint
            point = pin.Inertia(self.mass, np.array(self.com), np.zeros((3, 3)))
            loaded.inertias[joint] = model.inertias[joint] + tool.placement.act(point)
        return loaded

    def to_dict(self) -> dict[str, object]:
        """Return the payload as values that JSON can hold."""
        return {"mass": self.mass, "com": list(self.com)}

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Payload:
        """Return the payload that ``to_dict`` wrote.

        Raises:
            KeyError: a value is missing.
            InputError: a value is impossible.
        """
        return Payload(values["mass"], values["com"])


def centre_of_mass(values: ArrayLike) -> tuple[float, float, float]:
    """Return a payload's place in the tool frame as three plain numbers [m].

    Raises:
        InputError: the values are not three finite numbers.
    """
    x, y, z = finite_vector(values, 3, "the payload's com").tolist()
    return x, y, z

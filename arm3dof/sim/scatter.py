"""Bodies drawn at random, standing apart in a region of the table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from arm3dof.errors import InputError
from arm3dof.sim.world import COLOURS, SHAPES, Bin, Body, Colour, Shape, apart, touches
from arm3dof.state import frozen_array


@dataclass(frozen=True)
class Region:
    """Where objects are put: a part of a ring about the base's axis.

    Attributes:
        radius: nearest and farthest distance of an object's middle from the axis [m].
        bearing: lowest and highest angle from the base's x axis [rad].
    """

    radius: tuple[float, float] = (0.155, 0.225)
    bearing: tuple[float, float] = (-1.2, 1.2)

    def __post_init__(self) -> None:
        for name in ("radius", "bearing"):
            low, high = frozen_array(getattr(self, name), 2, name=name).tolist()
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise InputError(f"{name} is {getattr(self, name)}; give a lower and a higher one")
        if self.radius[0] <= 0:
            raise InputError(f"radius is {self.radius}; give metres above 0")

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """Draw a point (x, y) [m], evenly over the area."""
        radius = math.sqrt(rng.uniform(self.radius[0] ** 2, self.radius[1] ** 2))
        bearing = rng.uniform(*self.bearing)
        return radius * math.cos(bearing), radius * math.sin(bearing)


_TRIES = 300  # draws of one place before the others are drawn anew
_RESTARTS = 30


def scatter(
    rng: np.random.Generator,
    count: int,
    *,
    colours: Mapping[str, Colour] = COLOURS,
    region: Region | None = None,
    width_m: tuple[float, float] = (0.02, 0.04),
    height_m: tuple[float, float] = (0.04, 0.07),
    mass: tuple[float, float] = (0.010, 0.060),
    shapes: tuple[Shape, ...] = SHAPES,
    turn: float = 0.17,
    gap_m: float = 0.02,
    bins: tuple[Bin, ...] = (),
    others: tuple[Body, ...] = (),
) -> tuple[Body, ...]:
    """Draw bodies that stand apart in a region, their colours in turn.

    Args:
        rng: source of everything that is drawn.
        count: how many.
        colours: names and colours; a body is called ``red_0``, ``green_1`` and so on.
        region: where their middles may be; ``Region()`` without one.
        width_m: least and greatest width [m].
        height_m: least and greatest height of what is no cube [m].
        mass: least and greatest mass [kg].
        shapes: which shapes there may be.
        turn: how far a face may be turned away from the base's axis [rad], about which a gripper
            closes that cannot turn about the vertical.
        gap_m: least distance between two of them, and between one and a bin [m].
        bins: trays that they must not stand in.
        others: bodies that are there already, and that they must stand apart from too.

    Raises:
        InputError: there is no room for so many.
    """
    region = Region() if region is None else region
    for _ in range(_RESTARTS):
        bodies: list[Body] = []
        for index in range(count):
            name, colour = list(colours.items())[index % len(colours)]
            shape: Shape = shapes[int(rng.integers(len(shapes)))]
            width, height = rng.uniform(*width_m), rng.uniform(*height_m)
            size = width, width if shape == "cube" else height, rng.uniform(*mass)
            aside = rng.uniform(-turn, turn)
            for _ in range(_TRIES):
                x, y = region.draw(rng)
                yaw = math.atan2(y, x) + aside
                body = Body(f"{name}_{index}", shape, *size, colour, x, y, yaw)
                if all(apart(body, other) >= gap_m for other in (*bodies, *others)) and not any(
                    touches(body, tray, gap_m) for tray in bins
                ):
                    bodies.append(body)
                    break
            else:
                break
        if len(bodies) == count:
            return tuple(bodies)
    raise InputError(
        f"no room for {count} bodies of up to {width_m[1]} m that stand {gap_m} m apart in "
        f"{region}; ask for fewer, or for a larger region"
    )

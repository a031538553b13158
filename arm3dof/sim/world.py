"""What stands around an arm: a table, objects of one colour each, and bins to put them into.

These are descriptions alone, in the robot's base frame. ``MujocoPlant`` makes them move, and
``WorldCamera`` takes pictures of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any, Literal, get_args

from arm3dof.errors import InputError
from arm3dof.sim.table import Table
from arm3dof.state import frozen_array

Colour = tuple[float, float, float]
Shape = Literal["cylinder", "cube", "bottle"]
SHAPES: tuple[Shape, ...] = get_args(Shape)
Surface = Literal["wood", "plain"]

COLOURS: Mapping[str, Colour] = MappingProxyType(
    {
        "red": (0.80, 0.07, 0.06),
        "green": (0.06, 0.55, 0.16),
        "blue": (0.05, 0.22, 0.75),
        "yellow": (0.92, 0.76, 0.05),
    }
)
"""Colours of matte objects that can be told apart on wood: sRGB red, green, blue, 0 to 1."""

MUTED: Mapping[str, Colour] = MappingProxyType(
    {
        "grey": (0.45, 0.46, 0.47),
        "white": (0.88, 0.88, 0.86),
        "black": (0.07, 0.07, 0.08),
        "brown": (0.36, 0.27, 0.20),
    }
)
"""Colours of things that are in the way and that nobody looks for."""

WALL = 0.003
"""Thickness of a bin's walls [m]."""


@dataclass(frozen=True)
class Body:
    """An object that stands on the table.

    Attributes:
        name: what it is called; no two bodies of a world share one.
        shape: an upright ``cylinder``, a ``cube`` (a box with a square foot) or a ``bottle``.
        width_m: diameter, or edge of the foot [m].
        height_m: from foot to top [m].
        mass: [kg].
        colour: sRGB red, green, blue, 0 to 1.
        x: of the middle of its foot [m].
        y: of the middle of its foot [m].
        yaw: turn about the vertical [rad].

    Raises:
        InputError: the shape is unknown, or a number is outside its domain.
    """

    name: str
    shape: Shape
    width_m: float
    height_m: float
    mass: float
    colour: Colour
    x: float
    y: float
    yaw: float = 0.0

    def __post_init__(self) -> None:
        what = f"body '{self.name}'"
        if self.shape not in SHAPES:
            raise InputError(f"{what} is a {self.shape!r}; give one of: {', '.join(SHAPES)}")
        _positive(what, width_m=self.width_m, height_m=self.height_m, mass=self.mass)
        _finite(what, x=self.x, y=self.y, yaw=self.yaw)
        _colour(what, self.colour)

    @property
    def reach(self) -> float:
        """Radius of the upright cylinder that holds it [m]."""
        return self.width_m * (math.sqrt(0.5) if self.shape == "cube" else 0.5)


@dataclass(frozen=True)
class Bin:
    """A low open tray that lies along the base frame's axes.

    Attributes:
        name: what it is called, commonly the colour that belongs into it.
        x: of its middle [m].
        y: of its middle [m].
        half_size: (x, y) of its half lengths inside the walls [m].
        colour: sRGB red, green, blue, 0 to 1.
        wall_m: height of its walls [m].

    Raises:
        InputError: a number is outside its domain.
    """

    name: str
    x: float
    y: float
    half_size: tuple[float, float]
    colour: Colour
    wall_m: float = 0.012

    def __post_init__(self) -> None:
        what = f"bin '{self.name}'"
        _finite(what, x=self.x, y=self.y)
        x, y = frozen_array(self.half_size, 2, name=f"{what}: half_size").tolist()
        _positive(what, half_size_x=x, half_size_y=y, wall_m=self.wall_m)
        _colour(what, self.colour)

    def holds(self, x: float, y: float) -> bool:
        """Whether a point lies inside the walls."""
        return abs(x - self.x) <= self.half_size[0] and abs(y - self.y) <= self.half_size[1]

    def contains(self, body: Body) -> bool:
        """Whether a body that stands where it says stands clear of the walls inside."""
        return (
            abs(body.x - self.x) + body.reach <= self.half_size[0]
            and abs(body.y - self.y) + body.reach <= self.half_size[1]
        )


@dataclass(frozen=True)
class World:
    """A table with what stands on it, and the light that falls on it.

    Attributes:
        table: the table; a body that is beyond its edge counts as fallen.
        bodies: the objects.
        bins: the trays.
        light: brightness of the light; 1 exposes a picture well, 0.3 is dusk, 2 is glaring.
        friction: coefficient between objects and table.
        grip_friction: coefficient between objects and the gripper's pads.
        surface: of the table: ``wood`` with its grain, or ``plain`` grey.

    Raises:
        InputError: two bodies or two bins share a name, bodies stand in one another, in a bin's
            wall or beyond the table's edge, or a number is outside its domain.
    """

    table: Table = field(default_factory=Table)
    bodies: tuple[Body, ...] = ()
    bins: tuple[Bin, ...] = ()
    light: float = 1.0
    friction: float = 0.5
    grip_friction: float = 1.0
    surface: Surface = "wood"

    def __post_init__(self) -> None:
        object.__setattr__(self, "bodies", tuple(self.bodies))
        object.__setattr__(self, "bins", tuple(self.bins))
        if self.surface not in get_args(Surface):
            surfaces = ", ".join(get_args(Surface))
            raise InputError(f"the table's surface is {self.surface!r}; give one of: {surfaces}")
        _positive("the world", light=self.light)
        _positive("the world", friction=self.friction, grip_friction=self.grip_friction)
        for kind, parts in (("body", self.bodies), ("bin", self.bins)):
            for name, count in Counter(part.name for part in parts).items():
                if count > 1:
                    raise InputError(f"{count} are called {kind} '{name}'; give each its own name")
        for i, first in enumerate(self.bodies):
            for second in self.bodies[i + 1 :]:
                if apart(first, second) < 0:
                    raise InputError(
                        f"bodies '{first.name}' and '{second.name}' stand in one another at "
                        f"({first.x:.3f}, {first.y:.3f}) and ({second.x:.3f}, {second.y:.3f}); "
                        "put them further apart"
                    )
        self._check_places()

    def _check_places(self) -> None:
        for body in self.bodies:
            what = f"body '{body.name}' at ({body.x:.3f}, {body.y:.3f})"
            if not self.on_table(body.x, body.y):
                raise InputError(f"{what} is beyond the table's edge; put it on the table")
            for tray in self.bins:
                if touches(body, tray, 0.0) and not tray.contains(body):
                    raise InputError(
                        f"{what} stands in a wall of bin '{tray.name}'; put it inside or outside"
                    )

    def body(self, name: str) -> Body:
        """Return a body by name.

        Raises:
            InputError: there is no such body.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        known = ", ".join(body.name for body in self.bodies) or "none"
        raise InputError(f"no body '{name}'; this world has: {known}")

    def to_dict(self) -> dict[str, Any]:
        """Return the world as values that JSON can hold."""
        return asdict(self)

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> World:
        """Return the world that ``to_dict`` wrote.

        Raises:
            KeyError: a value is missing.
            TypeError: there is a value that a world does not have.
            InputError: a value is impossible.
        """
        parts = ("table", "bodies", "bins")
        plain = {name: value for name, value in values.items() if name not in parts}
        return World(
            table=Table(**_tuples(values["table"])),
            bodies=tuple(Body(**_tuples(body)) for body in values["bodies"]),
            bins=tuple(Bin(**_tuples(tray)) for tray in values["bins"]),
            **plain,
        )

    def on_table(self, x: float, y: float) -> bool:
        """Whether a point lies on the table."""
        centre, half = self.table.centre, self.table.half_size
        return abs(x - centre[0]) <= half[0] and abs(y - centre[1]) <= half[1]


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return keyword arguments with the lists of JSON as tuples."""
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}


def apart(first: Body, second: Body) -> float:
    """Return the distance between two bodies' bounding cylinders [m], negative inside."""
    return math.hypot(first.x - second.x, first.y - second.y) - first.reach - second.reach


def touches(body: Body, tray: Bin, gap: float) -> bool:
    """Whether a body comes nearer to a tray, walls included, than a gap."""
    dx = max(abs(body.x - tray.x) - tray.half_size[0] - WALL, 0.0)
    dy = max(abs(body.y - tray.y) - tray.half_size[1] - WALL, 0.0)
    return math.hypot(dx, dy) < body.reach + gap


# ---- checks ------------------------------------------------------------------------------------


def _positive(what: str, **values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{what}: {name} is {value}; give a number above 0")


def _finite(what: str, **values: float) -> None:
    for name, value in values.items():
        if not math.isfinite(value):
            raise InputError(f"{what}: {name} is {value}; give a finite number")


def _colour(what: str, colour: Colour) -> None:
    shares = frozen_array(colour, 3, name=f"{what}: colour")
    if not ((shares >= 0) & (shares <= 1)).all():
        raise InputError(f"{what}: colour is {colour}; give red, green and blue from 0 to 1")

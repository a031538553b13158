"""The objects and bins of a world, as the 3-D page shows them: ``/things/NAME``, ``/bins/NAME``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from arm3dof.sim.world import Bin, Body, Colour, World
from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_window import Command

_WALL = 0.003  # thickness of a bin's walls [m]
_BELLY = 0.7  # share of a bottle's height, below its neck
_NECK = 0.4  # width of a bottle's neck, as a share of the belly's


class Part(NamedTuple):
    """One shape of an object or bin: its name, its geometry and where its middle is [m]."""

    name: str
    shape: shapes.Shape
    middle: tuple[float, float, float]


def draw_world(world: World) -> list[Command]:
    """Return the commands that draw a world's objects, standing where it says, and its bins."""
    commands = [shapes.delete("/things"), shapes.delete("/bins")]
    for body in world.bodies:
        commands += _draw(thing_path(body.name), body_parts(body), body.colour)
        transform = pin.SE3(
            pin.utils.rotate("z", body.yaw),
            np.array([body.x, body.y, world.table.height + body.height_m / 2]),
        )
        commands.append(shapes.pose(thing_path(body.name), transform.homogeneous))
    for tray in world.bins:
        path = f"/bins/{tray.name}"
        commands += _draw(path, bin_parts(tray), tray.colour)
        commands.append(shapes.move(path, (tray.x, tray.y, world.table.height)))
    return commands


def body_poses(poses: Mapping[str, Array]) -> list[Command]:
    """Return the commands that put objects where they are.

    Args:
        poses: x, y, z and the quaternion x, y, z, w of each object's middle, shape (7,).
    """
    return [
        shapes.pose(thing_path(name), pin.XYZQUATToSE3(row).homogeneous)
        for name, row in poses.items()
    ]


def thing_path(name: str) -> str:
    """Return the path of an object's node."""
    return f"/things/{name}"


def body_parts(body: Body) -> Iterator[Part]:
    """Return the shapes of an object, in the frame of its middle."""
    radius, height = body.width_m / 2, body.height_m
    if body.shape == "cube":
        yield Part("0", shapes.box((body.width_m, body.width_m, height)), (0, 0, 0))
    elif body.shape == "cylinder":
        yield Part("0", shapes.cylinder(radius, height), (0, 0, 0))
    else:
        belly = shapes.cylinder(radius, _BELLY * height)
        yield Part("0", belly, (0, 0, (_BELLY - 1) / 2 * height))
        neck = shapes.cylinder(_NECK * radius, (1 - _BELLY) * height)
        yield Part("1", neck, (0, 0, _BELLY / 2 * height))


def bin_parts(tray: Bin) -> Iterator[Part]:
    """Return the shapes of a bin, in a frame at the middle of its foot."""
    x, y = tray.half_size
    yield Part("floor", shapes.box((2 * x, 2 * y, 0.0008)), (0, 0, 0.0004))
    for number, side in enumerate((-1.0, 1.0)):
        for name, at, size in (
            ("x", (side * (x + _WALL / 2), 0.0), (_WALL, 2 * y + 2 * _WALL)),
            ("y", (0.0, side * (y + _WALL / 2)), (2 * x, _WALL)),
        ):
            wall = shapes.box((*size, tray.wall_m))
            yield Part(f"{name}{number}", wall, (*at, tray.wall_m / 2))


def _draw(path: str, parts: Iterable[Part], colour: Colour) -> Iterator[Command]:
    look = shapes.material(colour)
    for part in parts:
        yield shapes.draw(f"{path}/{part.name}", part.shape, look)
        yield shapes.move(f"{path}/{part.name}", part.middle)

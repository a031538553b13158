"""The objects on the table, as the 3-D view shows them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from arm3dof.sim.world import Bin, Body, World
from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_window import Command

_WALL = 0.003  # thickness of a bin's walls [m]


def draw_world(world: World) -> list[Command]:
    """Return the commands that draw the objects and the bins of a world."""
    commands = [shapes.delete("/things"), shapes.delete("/bins")]
    for body in world.bodies:
        commands += _draw_body(body)
    for tray in world.bins:
        commands += _draw_bin(tray, world.table.height)
    return commands


def body_poses(world: World, poses: Array) -> list[Command]:
    """Return the commands that put the objects where they are.

    Args:
        world: the world.
        poses: (x, y, z, qw, qx, qy, qz) of each object, shape (n, 7).
    """
    commands = []
    for body, pose in zip(world.bodies, poses, strict=True):
        transform = np.eye(4)
        w, x, y, z = pose[3:]
        transform[:3, :3] = pin.Quaternion(w, x, y, z).normalized().matrix()
        transform[:3, 3] = pose[:3]
        commands.append(shapes.pose(f"/things/{body.name}", transform))
    return commands


def _draw_body(body: Body) -> Iterator[Command]:
    path, look = f"/things/{body.name}", shapes.material(body.colour)
    radius, height = body.width_m / 2, body.height_m
    if body.shape == "cube":
        yield shapes.draw(path, shapes.box((body.width_m, body.width_m, height)), look)
    elif body.shape == "cylinder":
        yield shapes.draw(path, shapes.cylinder(radius, height), look)
    else:
        yield shapes.draw(f"{path}/belly", shapes.cylinder(radius, 0.7 * height), look)
        yield shapes.move(f"{path}/belly", (0, 0, -0.15 * height))
        yield shapes.draw(f"{path}/neck", shapes.cylinder(0.45 * radius, 0.3 * height), look)
        yield shapes.move(f"{path}/neck", (0, 0, 0.35 * height))


def _draw_bin(tray: Bin, floor: float) -> Iterator[Command]:
    path, look = f"/bins/{tray.name}", shapes.material(tray.colour)
    x, y = tray.half_size
    sides = {
        "east": ((x + _WALL / 2, 0.0), (_WALL, 2 * y + 2 * _WALL)),
        "west": ((-x - _WALL / 2, 0.0), (_WALL, 2 * y + 2 * _WALL)),
        "north": ((0.0, y + _WALL / 2), (2 * x, _WALL)),
        "south": ((0.0, -y - _WALL / 2), (2 * x, _WALL)),
    }
    for name, (at, size) in sides.items():
        yield shapes.draw(f"{path}/{name}", shapes.box((*size, tray.wall_m)), look)
        yield shapes.move(f"{path}/{name}", (*at, tray.wall_m / 2))
    yield shapes.move(path, (tray.x, tray.y, floor))

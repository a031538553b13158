"""Pictures of a table scene by MuJoCo's camera, which knows nothing of our own renderer."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.table_scenes import TableScene
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.shapes import Ball, Box, Cylinder
from arm3dof.sim.table import Table
from arm3dof.sim.world import Body, Shape, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.state import Array

_AHEAD = 0.8  # the scene is moved so far along the line of sight: the arm is out of sight then [m]
_MASS = 0.03  # of each thing; nothing moves [kg]


def photograph(table: TableScene, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Take a picture of cylinders, cubes and bottles; balls among the clutter are left out.

    Args:
        table: the scene.
        rng: source of the sensor's noise.

    Returns:
        BGR picture, shape (height, width, 3), uint8.

    Raises:
        MissingExtra: MuJoCo is not installed.
        ArmError: this machine can draw nothing.
    """
    top = table.scene.table
    shapes = {id(it.solid): it.target.shape for it in table.placed}
    camera, pose = table.camera, table.camera.transform_base_camera.copy()
    shift = _AHEAD * pose[:2, 2] / np.linalg.norm(pose[:2, 2])
    bodies = [
        _body(f"thing {index}", solid, shift, shapes.get(id(solid)))
        for index, solid in enumerate(table.scene.solids)
        if not isinstance(solid, Ball)
    ]
    moved = Table(top.height, _at(top.centre, shift), top.half_size)
    plant = MujocoPlant(_arm(), World(moved, tuple(bodies), light=table.exposure))
    pose[:2, 3] += shift
    with WorldCamera(
        plant,
        camera.camera_matrix,
        pose,
        camera.width,
        camera.height,
        distortion=camera.distortion,
        noise=table.scene.noise,
        rng=rng,
    ) as taker:
        return taker.take()


@cache
def _arm() -> Robot:
    return load_robot("arm3dof")


def _body(name: str, solid: Cylinder | Box, shift: Array, shape: str | None) -> Body:
    x, y = _at(solid.centre[:2], shift)
    if isinstance(solid, Box):
        kind: Shape = "cube"
        width, yaw = solid.size[0], solid.yaw
    else:
        kind = "bottle" if shape == "bottle" else "cylinder"
        width, yaw = 2 * solid.radius, 0.0
    return Body(name, kind, width, 2 * solid.half_height, _MASS, solid.colour, x, y, yaw)


def _at(place: tuple[float, float], shift: Array) -> tuple[float, float]:
    return float(place[0] + shift[0]), float(place[1] + shift[1])

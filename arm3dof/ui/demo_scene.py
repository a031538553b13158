"""The demonstration's picture: a green cylinder among other things on the arm's table."""

from __future__ import annotations

import numpy as np

from arm3dof.sim.scene import Image, Scene, draw
from arm3dof.sim.shapes import Ball, Box, Cylinder, Solid
from arm3dof.sim.table import Table
from arm3dof.vision.camera import Camera

RADIUS, HEIGHT = 0.015, 0.045  # of the cylinder, as wide as the presets' targets [m]
_GREEN = (0.10, 0.62, 0.24)


def draw_demo(camera: Camera, rng: np.random.Generator) -> Image:
    """Draw the table as a camera without distortion sees it.

    Args:
        camera: the camera.
        rng: decides where the cylinder stands, and the sensor's noise.

    Returns:
        BGR picture of the camera's size, shape (height, width, 3), uint8.
    """
    return draw(
        demo_table(rng),
        camera.camera_matrix,
        camera.transform_base_camera,
        camera.width,
        camera.height,
        rng,
    )


def demo_table(rng: np.random.Generator) -> Scene:
    """Return the table; ``rng`` decides where the cylinder stands."""
    table = Table()
    return Scene((_cylinder(rng, table), *_clutter(table)), table)


def _cylinder(rng: np.random.Generator, table: Table) -> Solid:
    """Stand the cylinder somewhere in front of the arm, within its reach."""
    radius, bearing = rng.uniform(0.150, 0.185), rng.uniform(-0.35, 0.05)
    x, y = radius * np.cos(bearing), radius * np.sin(bearing)
    return Cylinder((x, y, table.height + HEIGHT / 2), RADIUS, HEIGHT, _GREEN)


def _clutter(table: Table) -> tuple[Solid, ...]:
    """Return things of other colours around the place where the cylinder may stand."""
    z = table.height
    return (
        Cylinder((0.205, -0.130, z + 0.014), RADIUS, 0.028, (0.80, 0.13, 0.11)),
        Cylinder((0.250, -0.045, z + 0.020), RADIUS, 0.040, (0.93, 0.72, 0.10)),
        Cylinder((0.075, -0.110, z + 0.020), RADIUS, 0.040, (0.13, 0.30, 0.72)),
        Box((0.330, 0.040, z + 0.018), (0.040, 0.030, 0.036), 0.5, (0.42, 0.43, 0.45)),
        Cylinder((0.310, -0.090, z + 0.030), 0.018, 0.060, (0.86, 0.86, 0.84)),
        Ball((0.115, -0.150, z + 0.013), 0.013, (0.50, 0.20, 0.58)),
    )

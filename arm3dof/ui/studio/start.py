"""What the studio begins with: an arm that stands at ease, and things to grasp before it."""

from __future__ import annotations

import importlib.util

import numpy as np

from arm3dof.model.robot import Robot
from arm3dof.sim.scene import Scene
from arm3dof.sim.world import COLOURS, Body, World
from arm3dof.state import Array
from arm3dof.ui.demo_scene import demo_table

_WIDTH, _HEIGHT, _MASS = 0.03, 0.05, 0.02  # of the cylinders that the presets look for
_RADIUS = 0.185  # of the arc that they stand on [m]
_BEARINGS = {"green": -28.0, "red": 4.0, "yellow": -56.0}  # [deg]; parts of the arm are blue


def home(robot: Robot) -> Array:
    """Return the middle of each joint's range, 0 for one that turns freely, shape (nv,) [rad]."""
    middle = robot.limits.q_min / 2 + robot.limits.q_max / 2
    return np.where(np.isfinite(middle), middle, 0.0)


def table() -> World | Scene:
    """Return coloured cylinders on a table: a world with physics, or a drawing without MuJoCo."""
    if importlib.util.find_spec("mujoco") is None:
        return demo_table(np.random.default_rng(0))
    return World(bodies=tuple(_cylinder(name, at) for name, at in _BEARINGS.items()))


def _cylinder(name: str, bearing_deg: float) -> Body:
    bearing = np.deg2rad(bearing_deg)
    x, y = float(_RADIUS * np.cos(bearing)), float(_RADIUS * np.sin(bearing))
    return Body(name, "cylinder", _WIDTH, _HEIGHT, _MASS, COLOURS[name], x, y)

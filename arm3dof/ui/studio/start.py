"""What the studio begins with: an arm that stands at ease, and things to grasp before it."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

import numpy as np

from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.robot import Robot
from arm3dof.sim.scene import Scene
from arm3dof.sim.world import COLOURS, Bin, Body, World
from arm3dof.state import Array
from arm3dof.ui.demo_scene import demo_table
from arm3dof.vision.camera import Camera, look_at

HOME = (0.11, 0.0, 0.12)
"""Where the tool waits while the camera looks, in the base frame [m]."""
_WIDTH, _HEIGHT, _MASS = 0.03, 0.05, 0.02  # of the cylinders that the presets look for
_ASIDE, _GAP = 0.07, 0.06  # how far a grasped thing is put aside, and from others [m]
_BIN_HALF, _BIN_RADIUS = (0.055, 0.055), 0.19  # [m]
_BINS = {"green": -83.0, "red": 83.0, "yellow": 130.0}  # their bearings [deg]
_RADIUS = 0.185  # of the arc that they stand on [m]
_BEARINGS = {"green": -28.0, "red": 4.0, "yellow": -56.0}  # [deg]; parts of the arm are blue


def home(robot: Robot) -> Array:
    """Return where the arm waits, shape (nv,) [rad].

    It is out of the camera's view where the arm gets there, else the middle of each joint's range.
    """
    reach = inverse_kinematics(robot, HOME)
    if reach.best is not None:
        return reach.best
    middle = robot.limits.q_min / 2 + robot.limits.q_max / 2
    return np.where(np.isfinite(middle), middle, 0.0)


def table() -> World | Scene:
    """Return coloured cylinders on a table: a world with physics, or a drawing without MuJoCo."""
    if importlib.util.find_spec("mujoco") is None:
        return demo_table(np.random.default_rng(0))
    bodies = tuple(_cylinder(name, at) for name, at in _BEARINGS.items())
    return World(bodies=bodies, bins=tuple(_bin(name, at) for name, at in _BINS.items()))


def free_place(x: float, y: float, others: Sequence[Array]) -> tuple[float, float]:
    """Return a place as far from the arm as (x, y) and to its side, clear of other things [m]."""
    radius, bearing = float(np.hypot(x, y)), float(np.arctan2(y, x))
    turns = (_ASIDE / radius * side for side in (1, -1, 1.5, -1.5, 2, -2))
    places = [(radius * np.cos(bearing + a), radius * np.sin(bearing + a)) for a in turns]
    room = [
        min((float(np.hypot(*(np.array(it) - other))) for other in others), default=np.inf)
        for it in places
    ]
    best = next((k for k, gap in enumerate(room) if gap > _GAP), int(np.argmax(room)))
    px, py = places[best]
    return float(px), float(py)


def _cylinder(name: str, bearing_deg: float) -> Body:
    bearing = np.deg2rad(bearing_deg)
    x, y = float(_RADIUS * np.cos(bearing)), float(_RADIUS * np.sin(bearing))
    return Body(name, "cylinder", _WIDTH, _HEIGHT, _MASS, COLOURS[name], x, y)


def _bin(name: str, bearing_deg: float) -> Bin:
    bearing = np.deg2rad(bearing_deg)
    x, y = float(_BIN_RADIUS * np.cos(bearing)), float(_BIN_RADIUS * np.sin(bearing))
    return Bin(name, x, y, _BIN_HALF, COLOURS[name])


def camera() -> Camera:
    """Return the camera of the simulated table: before the arm, looking down on its reach."""
    return Camera.pinhole(640, 480, 640.0, look_at([0.44, 0.0, 0.30], [0.16, 0.0, -0.10]))

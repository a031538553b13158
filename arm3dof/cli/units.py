"""Joint positions as people type and read them: degrees, and metres for a joint that slides."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.cli.options import numbers
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array


def to_degrees(robot: Robot, q: ArrayLike) -> Array:
    """Return joint positions, shape (..., nv), in degrees (metres for a sliding joint)."""
    return np.asarray(q, dtype=np.float64) * _per_radian(robot)


def read_configuration(robot: Robot, text: str, option: str) -> Array:
    """Read joint positions in degrees (metres for a sliding joint), shape (nv,) [rad or m].

    Raises:
        InputError: there are more or fewer than joints, one is no finite number, or one is outside
            its joint's limits.
    """
    given = np.array(numbers(text, robot.nv, option))
    q = given / _per_radian(robot)
    low, high = (to_degrees(robot, side) for side in (robot.limits.q_min, robot.limits.q_max))
    for joint, name in enumerate(robot.joint_names):
        if not low[joint] - 1e-9 <= given[joint] <= high[joint] + 1e-9:
            raise InputError(
                f"{option} puts {name} at {given[joint]:g}; "
                f"its limits are {low[joint]:.1f} to {high[joint]:.1f}"
            )
    return np.clip(q, robot.limits.q_min, robot.limits.q_max)


def unit(robot: Robot, joint: int) -> str:
    """Return the unit in which a joint's position is written."""
    return "m" if _slides(robot, joint) else "deg"


def _per_radian(robot: Robot) -> Array:
    slides = np.array([_slides(robot, joint) for joint in range(robot.nv)])
    return np.where(slides, 1.0, np.rad2deg(1.0))


def from_degrees(robot: Robot, joint: int, value: float) -> float:
    """Return one joint's position [rad] from degrees (metres for a sliding joint)."""
    return value / float(_per_radian(robot)[joint])


def _slides(robot: Robot, joint: int) -> bool:
    return str(robot.model.joints[joint + 1].shortname()).startswith("JointModelP")

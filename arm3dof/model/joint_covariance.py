"""What an uncertain target means for the joints that reach it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, finite_vector, frozen_array

_LEAST = 1e-3  # of the largest singular value: below that a direction tells the joints nothing


def joint_covariance(robot: Robot, q: ArrayLike, covariance_base: ArrayLike) -> Array:
    """Return the covariance of the joint angles that bring the tool to an uncertain point.

    To first order dq = J^+ dp with the position's Jacobian J at ``q``, so the covariance is
    J^+ S J^+T. Directions in which the tool cannot move, at a stretched-out elbow for instance, are
    left out: an error there cannot be reached at all.

    Args:
        robot: the robot.
        q: joint positions at the point, shape (nv,) [rad].
        covariance_base: covariance S of the point in the base frame, shape (3, 3) [m^2].

    Returns:
        Covariance of the joint positions, shape (nv, nv) [rad^2].

    Raises:
        InputError: an argument has another shape, or is not finite.
    """
    q = finite_vector(q, robot.nv, "q")
    covariance = frozen_array(covariance_base, 3, 3, name="covariance_base")
    if not np.isfinite(covariance).all():
        raise InputError("covariance_base holds what is not finite; give finite numbers")
    inverse = np.linalg.pinv(robot.jacobian(q)[:3], rcond=_LEAST)
    result: Array = inverse @ covariance @ inverse.T
    return result

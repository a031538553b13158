"""What a controller follows: one constant target, or a joint trajectory in time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.robot import Robot
from arm3dof.state import Array, frozen_array


class Reference(NamedTuple):
    """A target sampled at some times.

    Attributes:
        q: positions, shape (k, nv) [rad]; one row for a constant target.
        v: velocities, shape (k, nv) [rad/s].
    """

    q: Array
    v: Array


class JointTrajectory:
    """Positions at given times, joined by cubic Hermite segments; at rest before and after.

    Attributes:
        times: increasing times of the knots, shape (k,) [s].
        q: positions at the knots, shape (k, nv) [rad].
        v: velocities at the knots, shape (k, nv) [rad/s].
    """

    def __init__(self, times: ArrayLike, q: ArrayLike) -> None:
        """Create a trajectory with smooth velocities (finite differences of the knots).

        Raises:
            InputError: fewer than two knots, times that do not increase, shapes that do not
                match, or numbers that are not finite.
        """
        self.times = frozen_array(times, None, name="times")
        self.q = frozen_array(q, self.times.size, None, name="q")
        if self.times.size < 2 or not (np.diff(self.times) > 0).all():
            raise InputError(f"times is {self.times}; give two or more increasing times")
        if not (np.isfinite(self.q).all() and np.isfinite(self.times).all()):
            raise InputError("the trajectory holds NaN or infinity; give finite numbers")
        v = np.gradient(self.q, self.times, axis=0)
        v[0] = v[-1] = 0.0
        self.v = frozen_array(v, *v.shape, name="v")

    @property
    def duration(self) -> float:
        """Time from the first knot to the last [s]."""
        return float(self.times[-1] - self.times[0])

    def sample(self, times: ArrayLike) -> Reference:
        """Return the trajectory at some times, shape (k,) [s]."""
        t = np.clip(np.asarray(times, float), self.times[0], self.times[-1])
        left = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, self.times.size - 2)
        span = np.diff(self.times)[left][:, np.newaxis]
        s = (t - self.times[left])[:, np.newaxis] / span
        q0, q1 = self.q[left], self.q[left + 1]
        m0, m1 = self.v[left] * span, self.v[left + 1] * span
        q = (1 + 2 * s) * (1 - s) ** 2 * q0 + s * (1 - s) ** 2 * m0
        q += s**2 * (3 - 2 * s) * q1 - s**2 * (1 - s) * m1
        slope = 6 * s * (1 - s) * (q1 - q0)
        slope += (1 - s) * (1 - 3 * s) * m0 + s * (3 * s - 2) * m1
        return Reference(q, slope / span)


Target = ArrayLike | JointTrajectory
"""A constant joint target, shape (nv,) [rad], or a trajectory."""


def sample_target(target: Target, nv: int, t: float, dt: float, stages: int) -> Reference:
    """Return what to follow at times t, t + dt, ..., t + stages dt.

    Args:
        target: constant target or trajectory.
        nv: number of joints.
        t: time of the first sample [s].
        dt: time between samples [s].
        stages: number of samples after the first.

    Raises:
        InputError: the target belongs to a robot with another number of joints.
    """
    if isinstance(target, JointTrajectory):
        if target.q.shape[1] != nv:
            raise InputError(f"the trajectory has {target.q.shape[1]} joints; the robot has {nv}")
        return target.sample(t + dt * np.arange(stages + 1))
    q = frozen_array(target, nv, name="q_target")
    return Reference(q[np.newaxis], np.zeros((1, nv)))


def cartesian_path(robot: Robot, points: ArrayLike, times: ArrayLike) -> JointTrajectory:
    """Turn tool positions at given times into a joint trajectory, branch by branch unbroken.

    Each point takes the solution of its inverse kinematics that is nearest to the one before.

    Args:
        robot: the robot that follows the path.
        points: tool positions in the base frame, shape (k, 3) [m].
        times: their times, shape (k,) [s].

    Raises:
        InputError: a point is out of reach (the message says which, and why).
    """
    path = frozen_array(points, None, 3, name="points")
    q: list[Array] = []
    for index, point in enumerate(path):
        reach = inverse_kinematics(robot, point, near=q[-1] if q else None)
        if reach.best is None:
            raise InputError(f"point {index} of the path, {point} m: {reach.sentence}")
        q.append(reach.best)
    return JointTrajectory(times, np.array(q))

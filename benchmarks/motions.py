"""Closed loops whose states every contestant is asked about."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof import JointState, MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.runtime.experiment import default_start, default_target, simulate
from arm3dof.state import Array


class Motion(NamedTuple):
    """The states that a controller met on its way to a target, one row a control step.

    Attributes:
        q_target: shape (nv,) [rad].
        t: shape (k,) [s].
        q: shape (k, nv) [rad].
        v: shape (k, nv) [rad/s].
        saturation: share of the steps in which a torque was at its limit.
    """

    q_target: Array
    t: Array
    q: Array
    v: Array
    saturation: float

    @property
    def states(self) -> list[JointState]:
        """The states as a controller takes them."""
        return [JointState(*row) for row in zip(self.t, self.q, self.v, strict=True)]


def record_motions(
    robot: Robot, settings: MpcSettings, count: int, duration: float
) -> list[Motion]:
    """Return the robot's default motion and random ones from all of its joint range.

    Args:
        robot: the robot.
        settings: of the controller that drives it.
        count: number of motions, the default one included.
        duration: of each [s].
    """
    rng = np.random.default_rng(0)
    start = default_start(robot)
    pairs = [(start, default_target(robot, start))]
    pairs += [random_pair(robot, rng) for _ in range(count - 1)]
    return [_record(robot, settings, *pair, duration) for pair in pairs]


def random_pair(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a start and a target inside the joint limits, at most half a turn a joint apart."""
    start, target = robot.random_configuration(rng), robot.random_configuration(rng)
    return start, start + np.clip(target - start, -np.pi, np.pi)


def _record(
    robot: Robot, settings: MpcSettings, start: Array, target: Array, duration: float
) -> Motion:
    recording = simulate(robot, start, target, settings=settings, duration=duration)
    rows = recording.control_rows
    at_limit = np.abs(recording.tau[rows]) >= (1 - 1e-6) * robot.limits.tau_max
    saturation = float(at_limit.any(axis=1).mean())
    return Motion(target, recording.t[rows], recording.q[rows], recording.v[rows], saturation)

"""What a controller expects the arm to do over the horizon."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.state import Array


class Plan(NamedTuple):
    """What the arm is expected to do from a step on.

    Attributes:
        u: accelerations of stages 0..N, the last of which repeats the one before, (N + 1, nv)
            [rad/s^2].
        start: position and velocity at stage 0, each of shape (nv,) [rad, rad/s].
        states: positions and velocities at stages 1..N, shape (2, N, nv) [rad, rad/s].
    """

    u: Array
    start: tuple[Array, Array]
    states: Array

    @property
    def q(self) -> Array:
        """Positions at stages 0..N, shape (N + 1, nv) [rad]."""
        return np.vstack([self.start[0], self.states[0]])

    @property
    def v(self) -> Array:
        """Velocities at stages 0..N, shape (N + 1, nv) [rad/s]."""
        return np.vstack([self.start[1], self.states[1]])

    @staticmethod
    def of_one_stage(u: Array, q: Array, v: Array) -> Plan:
        """Return a plan that knows nothing beyond stage 0."""
        return Plan(u[np.newaxis], (q, v), np.zeros((2, 0, q.size)))

    def later(self, stages: int) -> Plan:
        """Return what is left of the plan after at least one stage."""
        q, v = self.states[:, stages - 1]
        return Plan(self.u[stages:], (q, v), self.states[:, stages:])

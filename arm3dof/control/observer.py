"""What the controller learns from how the arm answered: a disturbance, and where the arm will be.

Each command was meant to give a known acceleration u. While the command acts the arm obeys

    M a = tau - h + d,    and the command was computed from    M u = tau - h + d_hat,

so M (a - u) = d - d_hat: the difference between measured and intended acceleration shows what the
estimate d_hat misses. The same intended accelerations tell where the arm will be when a command
that is computed now begins to act.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_JUMP = 0.05  # [rad]: a position this far from where the velocities lead has jumped


class Observer:
    """Estimates the disturbance torque and predicts the state over the declared delay.

    Attributes:
        disturbance: estimated torque that acts beside the commanded one, shape (nv,) [N m].
        jumped: whether the last measured position does not follow from the one before it and the
            velocities; such a step teaches nothing about torques.
    """

    def __init__(self, robot: Robot, dt: float, gain: float, delay: float) -> None:
        """Create an observer that has seen nothing.

        Args:
            robot: the robot.
            dt: time between steps [s].
            gain: share of the missing disturbance that is learned in each step, 0 to 1.
            delay: time from a measurement to when the torque computed from it acts [s].
        """
        self._robot, self._dt, self._gain = robot, dt, gain
        self._whole = int(delay / dt + 1e-9)
        self._part = max(delay - self._whole * dt, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        nv = self._robot.nv
        self.disturbance = np.zeros(nv)
        # intended accelerations of the commands that act or are on their way, oldest first
        self._commands = deque([np.zeros(nv)] * (self._whole + 2), maxlen=self._whole + 2)
        self._last: JointState | None = None
        self.jumped = True

    def measure(self, state: JointState) -> None:
        """Learn from a measured state that can be believed."""
        self.jumped = self._last is None or self._has_jumped(self._last, state)
        if self._last is not None and not self.jumped and self._gain > 0:
            acceleration = (state.v - self._last.v) / self._dt
            older, newer = self._commands[0], self._commands[1]
            share = self._part / self._dt
            intended = share * older + (1 - share) * newer
            mass = self._robot.mass_matrix(self._last.q)
            missing = mass @ (acceleration - intended)
            limit = self._robot.limits.tau_max
            self.disturbance = np.clip(self.disturbance + self._gain * missing, -limit, limit)
        self._last = state

    def lose(self) -> None:
        """Note that this step's measurement cannot be believed."""
        self._last, self.jumped = None, True

    def _has_jumped(self, last: JointState, state: JointState) -> bool:
        slack = _JUMP + 0.5 * self._dt * np.abs(state.v - last.v)
        travelled = self._dt / 2 * (last.v + state.v)
        return bool((np.abs(state.q - last.q - travelled) > slack).any())

    def predict(self, state: JointState) -> JointState:
        """Return the state at the time when a command computed now begins to act."""
        if self._whole == 0 and self._part == 0.0:
            return state
        t, q, v = state.t, np.array(state.q), np.array(state.v)
        spans = [self._part] + [self._dt] * self._whole
        for span, u in zip(spans, list(self._commands)[1:], strict=True):
            t, q, v = t + span, q + span * v + span**2 / 2 * u, v + span * u
        return JointState(t, q, v)

    def command(self, acceleration: Array) -> None:
        """Note the acceleration that this step's command is meant to give."""
        self._commands.append(np.array(acceleration))

    def load(self, q: Array) -> float:
        """Return the mass at the tool that would explain the disturbance at rest [kg]."""
        lift = self._robot.jacobian(q)[:3].T @ self._robot.gravity_acceleration
        return float(lift @ self.disturbance / max(float(lift @ lift), 1e-12))

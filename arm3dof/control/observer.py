"""What the controller learns from how the arm answered: load, disturbance, where it will be.

A command holds a torque for one sample, and was meant to give a known acceleration. What the arm
did instead shows what the model misses (``load``), and what is left of that is a disturbance
torque. The intended accelerations also tell where the arm will be when a command that is computed
now begins to act.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from arm3dof.control.load import LoadEstimator
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_JUMP = 0.05  # [rad]: a position this far from where the velocities lead has jumped

_MOST_UNEXPLAINED = 3.0  # torque that may come from outside, in multiples of the joint's own


class Observer:
    """Estimates load and disturbance, and predicts the state over the declared delay.

    Attributes:
        disturbance: estimated torque that acts beside the commanded one, shape (nv,) [N m].
        estimator: what is known about the load.
        jumped: whether the last measured position does not follow from the one before it and the
            velocities; such a step teaches nothing about torques.
    """

    def __init__(self, robot: Robot, dt: float, gain: float, delay: float) -> None:
        """Create an observer that has seen nothing.

        Args:
            robot: the controller's own robot; it is taught what is learned about the load.
            dt: time between steps [s].
            gain: share of an unexplained torque that is learned in each step, 0 to 1; 0 learns
                nothing at all.
            delay: time from a measurement to when the torque computed from it acts [s].
        """
        self._robot, self._dt, self._gain = robot, dt, gain
        self._whole = int(delay / dt + 1e-9)
        self._part = max(delay - self._whole * dt, 0.0)
        self.estimator = LoadEstimator(robot)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        nothing = np.zeros(self._robot.nv)
        self.disturbance = nothing
        self.estimator.reset()
        self.estimator.teach(self._robot)
        # acceleration and torque of the commands that act or are on their way, oldest first
        length = self._whole + 2
        self._commands = deque([(nothing, nothing)] * length, maxlen=length)
        self._known = 0  # how many of them were given
        self._last: JointState | None = None
        self.jumped = True

    def measure(self, state: JointState) -> bool:
        """Learn from a measured state that can be believed.

        Returns:
            Whether the robot was taught other masses.
        """
        taught = False
        self.jumped = self._last is None or self._has_jumped(self._last, state)
        if self._last is not None and not self.jumped and self._gain > 0:
            taught = self._learn(self._last, state)
        self._last = state
        return taught

    def lose(self) -> None:
        """Note that this step's measurement cannot be believed."""
        self._last, self.jumped = None, True

    def predict(self, state: JointState) -> JointState:
        """Return the state at the time when a command computed now begins to act."""
        if self._whole == 0 and self._part == 0.0:
            return state
        t, q, v = state.t, np.array(state.q), np.array(state.v)
        spans = [self._part] + [self._dt] * self._whole
        for span, (u, _) in zip(spans, list(self._commands)[1:], strict=True):
            t, q, v = t + span, q + span * v + span**2 / 2 * u, v + span * u
        return JointState(t, q, v)

    def command(self, acceleration: Array, torque: Array) -> None:
        """Note this step's command.

        Args:
            acceleration: what it is meant to give, shape (nv,) [rad/s^2].
            torque: its torque without friction compensation, shape (nv,) [N m].
        """
        self._commands.append((acceleration, torque))
        self._known += 1

    def _learn(self, last: JointState, state: JointState) -> bool:
        if self._known < len(self._commands):
            return False  # what acted before the first command is not known
        share = self._part / self._dt
        torque = share * self._commands[0][1] + (1 - share) * self._commands[1][1]
        acceleration = (state.v - last.v) / self._dt
        q, v = (last.q + state.q) / 2, (last.v + state.v) / 2
        most = _MOST_UNEXPLAINED * self._robot.limits.tau_max
        if (np.abs(self.estimator.unexplained(q, v, acceleration, torque)) > most).any():
            self.jumped = True  # no load or push does this: the measurements do not belong together
            return False
        self.estimator.learn()
        taught = self.estimator.teach(self._robot)
        limit = self._robot.limits.tau_max
        learned = self.disturbance - self._gain * (self.estimator.remainder() + self.disturbance)
        self.disturbance = np.minimum(np.maximum(learned, -limit), limit)
        return taught

    def _has_jumped(self, last: JointState, state: JointState) -> bool:
        half = self._dt / 2
        gap = np.abs(state.q - last.q - half * (last.v + state.v))
        return bool((gap > _JUMP + half * np.abs(state.v - last.v)).any())

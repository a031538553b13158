"""A torque for every step in which there is no optimum: the previous plan, then braking."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.control.program import Optimum
from arm3dof.control.step import TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_BRAKING_STEPS = 2.0  # braking halves the speed in each step


class Answer(NamedTuple):
    """A torque, where it comes from, and the prediction that goes with it.

    Attributes:
        tau: torque, not yet limited, shape (nv,) [N m].
        u: acceleration that the torque is meant to give, shape (nv,) [rad/s^2].
        plan: predicted states [e; v], shape (any, 2 nv) [rad, rad/s].
        source: where the torque comes from.
    """

    tau: Array
    u: Array
    plan: Array
    source: TorqueSource


class Fallback:
    """Remembers the last good plan and answers from it while it is valid."""

    def __init__(self, robot: Robot, dt: float, validity: float) -> None:
        self._robot, self._dt = robot, dt
        self._most_steps = int(validity / dt + 1e-9)
        self.reset()

    def reset(self) -> None:
        """Forget the plan."""
        self._plan: Optimum | None = None
        self._q_target = np.zeros(self._robot.nv)
        self._age = 0

    def remember(self, plan: Optimum, q_target: Array) -> None:
        """Keep the plan of a good step."""
        self._plan, self._q_target, self._age = plan, q_target, 0

    def answer(self, state: JointState | None) -> Answer:
        """Return a torque for a step without an optimum, and let the plan grow older.

        Args:
            state: the measured state; ``None`` when it cannot be believed. Then the plan's
                prediction stands in for it, and without any plan the torque is zero.
        """
        self._age += 1
        nv = self._robot.nv
        believed = state or self._believed()
        if believed is None:
            zero = np.zeros(nv)
            return Answer(zero, zero, np.zeros((1, 2 * nv)), TorqueSource.BRAKING)
        if self._plan is not None and self._age <= min(self._most_steps, len(self._plan.u) - 1):
            u = self._plan.u[self._age]
            plan, source = self._plan.x[self._age :], TorqueSource.PREVIOUS_PLAN
        else:
            u = -believed.v / (_BRAKING_STEPS * self._dt)
            plan = np.concatenate([self._q_target - believed.q, believed.v])[np.newaxis]
            source = TorqueSource.BRAKING
        tau = self._robot.inverse_dynamics(believed.q, believed.v, u)
        return Answer(tau, u, plan, source)

    def _believed(self) -> JointState | None:
        """Return where the plan says that the arm is now; at rest once the plan has ended."""
        if self._plan is None:
            return None
        row = min(self._age, len(self._plan.x) - 1)
        error, v = np.split(self._plan.x[row], 2)
        moving = self._age <= self._most_steps
        return JointState(0.0, self._q_target - error, v if moving else np.zeros_like(v))

"""A torque for every step in which there is no optimum: the previous plan, then braking."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.control.plan import Plan
from arm3dof.control.step import TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_BRAKING_STEPS = 2.0  # braking halves the speed in each step


class Answer(NamedTuple):
    """A torque, where it comes from, and what it is meant to do.

    Attributes:
        tau: torque, not yet limited, shape (nv,) [N m].
        rigid: the part of it that does not fight dry friction, shape (nv,) [N m].
        u: the controller's input of (22), shape (nv,) [rad/s^2].
        acceleration: what the torque is meant to give, shape (nv,) [rad/s^2].
        plan: what the arm is expected to do, at least one stage.
        source: where the torque comes from.
    """

    tau: Array
    rigid: Array
    u: Array
    acceleration: Array
    plan: Plan
    source: TorqueSource


class Fallback:
    """Remembers the last good plan and answers from it while it is valid."""

    def __init__(self, robot: Robot, dt: float, validity: float) -> None:
        self._robot, self._dt = robot, dt
        self._most_steps = int(validity / dt + 1e-9)
        self.reset()

    def reset(self) -> None:
        """Forget the plan."""
        self._plan: Plan | None = None
        self._age = 0
        self._fits = False

    def expire(self) -> None:
        """Stop following the plan, and offering it as a start for the next one.

        It may still tell where the arm is while measurements are missing.
        """
        self._fits = False

    def remember(self, plan: Plan) -> None:
        """Keep the plan of a good step."""
        self._plan, self._age, self._fits = plan, 0, True

    def shifted(self, horizon: int) -> Array | None:
        """Return the last plan's accelerations, moved to the step after it, shape (N, nv).

        ``None`` when there is no plan, or it has expired or is older than one step.
        """
        if self._plan is None or not self._fits or self._age > 0:
            return None
        return self._plan.u[1 : horizon + 1]

    def answer(self, state: JointState | None, disturbance: Array) -> Answer:
        """Return a torque for a step without an optimum, and let the plan grow older.

        Args:
            state: the state; ``None`` when it cannot be believed. Then the plan's prediction
                stands in for it, and without any plan the torque is zero.
            disturbance: estimated disturbance torque, shape (nv,) [N m].
        """
        self._age += 1
        believed = state or self._believed()
        if believed is None:
            nothing = np.zeros(self._robot.nv)
            plan = Plan.of_one_stage(nothing, nothing, nothing)
            return Answer(nothing, nothing, nothing, nothing, plan, TorqueSource.BRAKING)
        valid = self._plan is not None and self._age <= min(
            self._most_steps,
            len(self._plan.u) - 2,  # the last row repeats the one before
        )
        if self._plan is not None and valid and (self._fits or state is None):
            rest = self._plan.later(self._age)
            u, source = rest.u[0], TorqueSource.PREVIOUS_PLAN
        else:
            u = -believed.v / (_BRAKING_STEPS * self._dt)
            rest = Plan.of_one_stage(u, believed.q, believed.v)
            source = TorqueSource.BRAKING
        tau = self._robot.inverse_dynamics(believed.q, believed.v, u) - disturbance
        rigid = tau - self._robot.friction * np.sign(believed.v)
        return Answer(tau, rigid, u, u, rest, source)

    def _believed(self) -> JointState | None:
        """Return where the plan says that the arm is now; at rest once the plan has ended."""
        if self._plan is None:
            return None
        q, v = self._plan.states[:, min(self._age, self._plan.states.shape[1]) - 1]
        return JointState(0.0, q, v * (self._age <= self._most_steps))

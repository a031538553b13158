"""The brake: to rest as fast as the torque allows."""

from __future__ import annotations

import numpy as np

from arm3dof.control.fallback import Fallback
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_AT_REST = 0.05  # [rad/s]: a slower joint has been braked


class Brake:
    """Brings an arm to rest, asked once a frame."""

    def __init__(self, robot: Robot, dt: float) -> None:
        """Create a brake.

        Args:
            robot: the arm as its controller knows it.
            dt: time between two answers [s].
        """
        self._fallback = Fallback(robot, dt, 0.0)

    def reset(self) -> None:
        """Begin anew."""
        self._fallback.reset()

    def is_done(self, state: JointState) -> bool:
        """Return whether the arm is at rest."""
        return bool((np.abs(state.v) < _AT_REST).all())

    def step(self, state: JointState, tau_max: Array) -> ControlStep:
        """Return the torque until the next step.

        Args:
            state: what the joints say.
            tau_max: limits of the torque, shape (nv,) [N m].
        """
        answer = self._fallback.answer(state, np.zeros(state.v.size))
        tau = np.clip(answer.tau, -tau_max, tau_max)
        return unplanned(tau, answer.u, TorqueSource.BRAKING)


def unplanned(tau: Array, u: Array, source: TorqueSource) -> ControlStep:
    """Return an answer that no controller has given: a torque without a plan."""
    plan = np.zeros((0, 2 * tau.size))
    return ControlStep(tau, u, plan, ControlStatus.SOLVED, source, 0.0)

"""Torque itself as the decision, on dynamics linearised along the last plan.

This is what the paper's last section asks for. Around a plan (q, v, a) with torques tau,
Pinocchio's analytic derivatives of inverse dynamics give the change of acceleration

    da = -M^-1 (d tau/dq dq + d tau/dv dv) + M^-1 dtau,

and with it a linear time-varying prediction. The decision is the change of torque, written as
M(q_0) w so that H is well conditioned; the cost is that of the other formulations, on error,
velocity and acceleration.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof.control.formulation import (
    Weights,
    block_of_stage,
    blocked,
    damping_share,
    invert_hessian,
    solve_hessian,
)
from arm3dof.control.program import LinearProgram, Program
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_WORST_CONDITION = 1e13  # an arm is unstable without feedback: H spans many orders of magnitude


class TorqueFormulation:
    """Builds the program of one control step from dynamics linearised along the last plan."""

    linearisations = 3

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        self.weights = Weights(settings, robot.nv)
        self._robot, self._dt = robot, settings.dt
        self._data = robot.model.createData()
        self._blocks = block_of_stage(settings)
        self._damping = np.diag(robot.damping)
        self._damping_inertia = settings.dt * self._damping * damping_share(robot, settings.dt)

    def reset(self) -> None:
        """Do nothing: each step is linearised anew."""

    def build(
        self, state: JointState, reference: Reference, plan: Array | None, disturbance: Array
    ) -> Program:
        """Return the program of one step; see ``Formulation.build``."""
        horizon, nv = self._blocks.size, state.q.size
        if plan is None:
            plan = np.zeros((horizon, nv))
        states = self._roll_out(state, plan)
        torque, by_state, by_torque = self._linearise(states, plan)
        unit = self._robot.mass_matrix(state.q)
        response, acceleration = self._respond(by_state, by_torque, unit)
        deviation = np.empty((horizon + 1, 2 * nv))
        deviation[:, :nv] = reference.q - states[:, 0]
        deviation[:, nv:] = states[:, 1] - reference.v
        Q, R, P = self.weights.Q, self.weights.R, self.weights.P
        signed = response.reshape(horizon + 1, 2, nv, -1) * np.array([-1.0, 1.0])[:, None, None]
        signed = signed.reshape(horizon + 1, 2 * nv, -1)
        weighed = Q @ signed
        weighed[-1] = P @ signed[-1]
        n = signed.shape[-1]
        costly = (R @ acceleration).reshape(-1, n)
        half = weighed.reshape(-1, n).T @ signed.reshape(-1, n)
        half += costly.T @ acceleration.reshape(-1, n)
        gradient = 2 * (weighed.reshape(-1, n).T @ deviation.ravel() + costly.T @ plan.ravel())
        hessian, inverse = invert_hessian(half + half.T, _WORST_CONDITION)
        return LinearProgram(
            hessian=hessian,
            hessian_inverse=inverse,
            w_free=-solve_hessian(hessian, inverse, gradient),
            block_of_stage=self._blocks,
            torque_gain=np.broadcast_to(unit, (horizon, nv, nv)),
            torque_offset=torque - disturbance,
            free_response=np.ascontiguousarray(states[1:].swapaxes(0, 1)),
            response=np.ascontiguousarray(
                response.reshape(horizon + 1, 2, nv, n)[1:].swapaxes(0, 1)
            ),
        )

    def _roll_out(self, state: JointState, plan: Array) -> Array:
        """Return positions and velocities under a plan of accelerations, (N + 1, 2, nv)."""
        states = np.empty((len(plan) + 1, 2, state.q.size))
        states[0] = state.q, state.v
        states[1:, 1] = state.v + self._dt * np.cumsum(plan, axis=0)
        steps = self._dt * states[:-1, 1] + self._dt**2 / 2 * plan
        states[1:, 0] = state.q + np.cumsum(steps, axis=0)
        return states

    def _linearise(self, states: Array, plan: Array) -> tuple[Array, Array, Array]:
        """Evaluate inverse dynamics and its derivatives in the middle of each sample.

        Returns:
            Torque of the plan (N, nv), d a / d [q, v] (N, nv, 2 nv) and d a / d tau (N, nv, nv).
        """
        horizon, nv = plan.shape
        half = self._dt / 2
        v = states[:-1, 1] + half * plan
        q = states[:-1, 0] + half * states[:-1, 1] + half**2 / 2 * plan
        torque = np.empty((horizon, nv))
        by_state = np.empty((horizon, nv, 2 * nv))
        inertia = np.empty((horizon, nv, nv))
        model, data = self._robot.model, self._data
        for k in range(horizon):
            by_q, by_v, mass = pin.computeRNEADerivatives(model, data, q[k], v[k], plan[k])
            by_state[k, :, :nv], by_state[k, :, nv:], inertia[k] = by_q, by_v, mass
            torque[k] = data.tau
        inertia += self._damping_inertia
        by_state[:, :, nv:] += self._damping
        torque += states[:-1, 1] @ self._damping + plan @ self._damping_inertia
        by_torque = np.linalg.inv(inertia)
        return torque, np.asarray(-by_torque @ by_state), np.asarray(by_torque)

    def _respond(self, by_state: Array, by_torque: Array, unit: Array) -> tuple[Array, Array]:
        """Return d [q, v] / d w of stages 0..N and d a / d w of stages 0..N-1."""
        horizon, nv = by_torque.shape[:2]
        dt = self._dt
        columns: Array = np.asarray(np.kron(np.eye(horizon), unit)).reshape(horizon, nv, -1)
        columns = blocked(columns, self._blocks, nv)
        response = np.zeros((horizon + 1, 2 * nv, columns.shape[-1]))
        acceleration = np.empty((horizon, nv, columns.shape[-1]))
        for k in range(horizon):
            a = by_state[k] @ response[k] + by_torque[k] @ columns[k]
            q, v = response[k, :nv], response[k, nv:]
            response[k + 1, :nv] = q + dt * v + dt**2 / 2 * a
            response[k + 1, nv:] = v + dt * a
            acceleration[k] = a
        return response, acceleration

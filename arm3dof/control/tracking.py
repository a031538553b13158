"""The default formulation: decide joint accelerations, so that the prediction is exact.

With u = q'' as the decision the prediction is a double integrator for every arm: C, F and the
Hessian are constant and are computed once. What is nonlinear, and only that, moves into the torque
limits: tau_k = M(q_k) u_k + C(q_k, v_k) v_k + g(q_k) is evaluated along the last plan, shifted to
now (the real-time iteration of Diehl, Bock and Schloeder 2005), in the middle of each sample.
Stages whose plan hardly moved keep their torque rows, which most do.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof.control.formulation import (
    Weights,
    block_of_stage,
    blocked,
    damping_share,
    discretise,
    invert_hessian,
)
from arm3dof.control.prediction import condense, double_integrator, quadratic_cost
from arm3dof.control.program import Program
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_MOVED_POSITION = 0.02  # [rad]: a stage that moved less keeps its torque row
_MOVED_SPEED = 0.2  # [rad/s]


class TrackingFormulation:
    """Builds the program of one control step from constant matrices and the last plan."""

    linearisations = 3

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        nv, horizon, dt = robot.nv, settings.horizon, settings.dt
        self.weights = Weights(settings, nv)
        self._dt = dt
        self._model, self._data = robot.model, robot.model.createData()
        self._blocks = block_of_stage(settings)
        prediction = condense(discretise(double_integrator(nv), settings), horizon)
        cost = quadratic_cost(prediction, self.weights.Q, self.weights.R, self.weights.P)
        half = blocked(cost.H, self._blocks, nv)
        self._hessian, self._inverse = invert_hessian(blocked(half.T, self._blocks, nv))
        # w_free = -H^-1 (2 F' Q) X_free, with X_free = [e; v - v_target] of stages 0..N at u = 0
        F = blocked(prediction.F, self._blocks, nv)
        stacked = F.reshape(horizon + 1, 2 * nv, -1)
        weighed = 2 * self.weights.Q @ stacked
        weighed[-1] = 2 * self.weights.P @ stacked[-1]
        self._gain = -self._inverse @ weighed.reshape(F.shape).T
        split = F.reshape(horizon + 1, 2, nv, -1)[1:].swapaxes(0, 1)
        self._response = np.ascontiguousarray(split * np.array([-1.0, 1.0])[:, None, None, None])
        self._times = dt * np.arange(horizon + 1)[:, np.newaxis]
        # positions and velocities in the middle of each sample, and velocities at its start, as
        # functions of the plan: the double integrator is the same for every joint
        velocity = np.tril(np.full((horizon, horizon), dt), -1)
        middle_velocity = velocity + dt / 2 * np.eye(horizon)
        position = np.vstack([np.zeros(horizon), np.cumsum(dt * middle_velocity, axis=0)[:-1]])
        middle_position = position + dt / 2 * velocity + dt**2 / 8 * np.eye(horizon)
        self._to_middle = np.vstack([middle_position, middle_velocity])
        self._to_start_velocity = velocity
        self._moved = np.repeat([_MOVED_POSITION, _MOVED_SPEED], horizon)[:, np.newaxis]
        self._damping = robot.damping
        self._damping_inertia = np.diag(dt * robot.damping * damping_share(robot, dt))
        self._zero = np.zeros(nv)
        self._gains = np.zeros((horizon, nv, nv))
        self._offsets = np.zeros((horizon, nv))
        self._at = np.empty((2 * horizon, nv))  # middle positions, then middle velocities
        self.reset()

    def reset(self) -> None:
        """Forget the torque rows, so that the next step evaluates them all."""
        self._at.fill(np.inf)

    def build(
        self, state: JointState, reference: Reference, plan: Array, disturbance: Array
    ) -> Program:
        """Return the program of one step; see ``Formulation.build``."""
        nv = state.q.size
        drift = state.q + self._times * state.v
        error = np.empty((len(drift), 2 * nv))
        error[:, :nv] = reference.q - drift
        error[:, nv:] = state.v - reference.v
        self._linearise(state, plan)
        free = np.empty((2, len(plan), nv))
        free[0], free[1] = drift[1:], state.v
        return Program(
            hessian=self._hessian,
            hessian_inverse=self._inverse,
            w_free=self._gain @ error.ravel(),
            block_of_stage=self._blocks,
            torque_gain=self._gains.copy(),
            torque_offset=self._offsets - disturbance,
            free_response=free,
            response=self._response,
        )

    def advance(self) -> None:
        """Move the torque rows one stage ahead, to the next control step."""
        middle = self._at.reshape(2, -1, self._zero.size)
        for rows in (self._gains, self._offsets, middle[0], middle[1]):
            rows[:-1] = rows[1:]

    def _linearise(self, state: JointState, plan: Array) -> None:
        """Evaluate tau = gain u + offset where the plan has moved, and always at stage 0."""
        horizon = len(plan)
        middle = self._to_middle @ plan
        middle[:horizon] += state.q + (self._times[:-1] + self._dt / 2) * state.v
        middle[horizon:] += state.v
        far = np.asarray((np.abs(self._at - middle) > self._moved).any(axis=1))
        moved = far[:horizon] | far[horizon:]
        moved[0] = True
        start_velocity = state.v + self._to_start_velocity @ plan
        model, data, zero = self._model, self._data, self._zero
        for k in moved.nonzero()[0].tolist():
            q, v = middle[k], middle[horizon + k]
            self._at[k], self._at[horizon + k] = q, v
            self._gains[k] = pin.crba(model, data, q) + self._damping_inertia
            torque = pin.rnea(model, data, q, v, zero)
            self._offsets[k] = torque + self._damping * start_velocity[k]

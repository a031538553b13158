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

_MOVED_POSITION = 0.01  # [rad]: a stage that moved less keeps its torque row
_MOVED_SPEED = 0.05  # [rad/s]


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
        per_stage = prediction.F.reshape(horizon + 1, 2, nv, horizon, nv)[:, :, 0, :, 0]
        self._to_position, self._to_velocity = -per_stage[:, 0], np.array(per_stage[:, 1])
        self._damping = robot.damping
        self._damping_inertia = np.diag(dt * robot.damping * damping_share(robot, dt))
        self._zero = np.zeros(nv)
        self._gains = np.zeros((horizon, nv, nv))
        self._offsets = np.zeros((horizon, nv))
        self._at = np.empty((2, horizon, nv))
        self.reset()

    def reset(self) -> None:
        """Forget the torque rows, so that the next step evaluates them all."""
        self._at.fill(np.inf)

    def build(
        self, state: JointState, reference: Reference, plan: Array, disturbance: Array
    ) -> Program:
        """Return the program of one step; see ``Formulation.build``."""
        drift = state.q + self._times * state.v
        error = np.concatenate([reference.q - drift, state.v - reference.v], axis=1)
        self._linearise(drift, state.v, plan)
        velocity = np.broadcast_to(state.v, drift.shape)
        return Program(
            hessian=self._hessian,
            hessian_inverse=self._inverse,
            w_free=self._gain @ error.ravel(),
            block_of_stage=self._blocks,
            torque_gain=self._gains.copy(),
            torque_offset=self._offsets - disturbance,
            free_response=np.stack([drift[1:], velocity[1:]]),
            response=self._response,
        )

    def advance(self) -> None:
        """Move the torque rows one stage ahead, to the next control step."""
        for rows in (self._gains, self._offsets, self._at[0], self._at[1]):
            rows[:-1] = rows[1:]

    def _linearise(self, drift: Array, v: Array, plan: Array) -> None:
        """Evaluate tau = gain u + offset where the plan has moved, and always at stage 0."""
        q = drift + self._to_position @ plan
        velocity = v + self._to_velocity @ plan
        half = self._dt / 2
        q_middle = q[:-1] + half * velocity[:-1] + half**2 / 2 * plan
        v_middle = velocity[:-1] + half * plan
        still = np.abs(self._at[0] - q_middle).max(axis=1) < _MOVED_POSITION
        still &= np.abs(self._at[1] - v_middle).max(axis=1) < _MOVED_SPEED
        still[0] = False
        model, data, zero = self._model, self._data, self._zero
        for k in np.flatnonzero(~still).tolist():
            self._at[0, k], self._at[1, k] = q_middle[k], v_middle[k]
            self._gains[k] = pin.crba(model, data, q_middle[k])
            self._gains[k] += self._damping_inertia
            self._offsets[k] = pin.rnea(model, data, q_middle[k], v_middle[k], zero)
            self._offsets[k] += self._damping * velocity[k]

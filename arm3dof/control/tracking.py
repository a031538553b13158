"""The default formulation: decide joint accelerations, so that the prediction is exact.

With u = q'' as the decision the prediction is a double integrator for every arm: C, F and the
Hessian are constant and are computed once. What is nonlinear, and only that, is the torque
tau_k = M(q_k) u_k + C(q_k, v_k) v_k + g(q_k) that a stage takes. It is evaluated exactly. Only at
stages where it meets its limit does its tangent along the last plan stand in for it (the real-time
iteration of Diehl, Bock and Schloeder 2005), with the terms that the motion before the stage has:

    d tau_k = M du_k + d tau / dq dq_k(w) + d tau / dv dv_k(w).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.formulation import (
    Weights,
    block_of_stage,
    blocked,
    discretise,
    invert_hessian,
)
from arm3dof.control.horizon_torque import HorizonTorque
from arm3dof.control.motion import Motion, MotionMap
from arm3dof.control.prediction import condense, double_integrator, quadratic_cost
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


class TrackingFormulation:
    """Builds the program of one control step from constant matrices."""

    linearisations = 1

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        nv, horizon = robot.nv, settings.horizon
        self.weights = Weights(settings, nv)
        self._blocks = block_of_stage(settings)
        self._first_stages = np.flatnonzero(np.diff(self._blocks, prepend=-1))
        prediction = condense(discretise(double_integrator(nv), settings), horizon)
        cost = quadratic_cost(prediction, self.weights.Q, self.weights.R, self.weights.P)
        half = blocked(cost.H, self._blocks, nv)
        self._constants = Constants(robot, settings, blocked(half.T, self._blocks, nv))
        # w_free = -H^-1 (2 F' Q) X_free, with X_free = [e; v - v_target] of stages 0..N at u = 0
        F = blocked(prediction.F, self._blocks, nv)
        stacked = F.reshape(horizon + 1, 2 * nv, -1)
        weighed = 2 * self.weights.Q @ stacked
        weighed[-1] = 2 * self.weights.P @ stacked[-1]
        self._gain = -self._constants.hessian_inverse @ weighed.reshape(F.shape).T
        self._state_gain = self._gain @ prediction.C

    def reset(self) -> None:
        """Take over the robot's masses as they are now."""
        self._constants.torque.refresh()

    def advance(self) -> None:
        """Do nothing: the solver remembers what mattered."""

    def build(
        self, state: JointState, reference: Reference, plan: Array | None, disturbance: Array
    ) -> TrackingProgram:
        """Return the program of one step; see ``Formulation.build``."""
        q, v = state.q, state.v
        if len(reference.q) == 1:
            w_free = self._state_gain @ np.concatenate((reference.q[0] - q, v))
        else:
            w_free = self._state_gain @ np.concatenate((-q, v))
            w_free += self._gain @ np.hstack([reference.q, -reference.v]).ravel()
        start = None if plan is None else plan[self._first_stages].ravel()
        return TrackingProgram(self._constants, q, v, disturbance, w_free, start)


class Constants:
    """What the programs of all steps have in common.

    Attributes:
        hessian: H, shape (n, n).
        hessian_inverse: H^-1, shape (n, n).
        motion: from decisions to motion.
        torque: from motion to torque.
        response: derivative of positions and velocities at stages 1..N by w, (2, N, nv, n).
        reached: which of them depend on w at all, shape (2, N, nv).
        to_middle: derivative of [q_middle, v_middle, u] of a joint by its decisions,
            shape (N, decisions a joint, 3).
    """

    def __init__(self, robot: Robot, settings: MpcSettings, hessian: Array) -> None:
        self.hessian, self.hessian_inverse = invert_hessian(hessian)
        self.motion, self.torque = MotionMap(settings), HorizonTorque(robot, settings.dt)
        by_decision, nv = self.motion.by_decision, robot.nv
        response = np.einsum("ckb,ij->ckibj", by_decision[:2], np.eye(nv))
        self.response = np.ascontiguousarray(response).reshape(2, settings.horizon, nv, -1)
        self.reached: NDArray[np.bool_] = np.asarray(self.response.any(axis=-1))
        self.to_middle = np.ascontiguousarray(by_decision[2:].transpose(1, 2, 0))


class TrackingProgram:
    """The program of one step; see ``Program``."""

    exact, refine = False, False

    def __init__(
        self,
        constants: Constants,
        q: Array,
        v: Array,
        disturbance: Array,
        w_free: Array,
        start: Array | None,
    ) -> None:
        self.hessian, self.hessian_inverse = constants.hessian, constants.hessian_inverse
        self.reached = constants.reached
        self.w_free, self.start = w_free, start
        self._constants, self._q, self._v, self._disturbance = constants, q, v, disturbance
        self._tangents: Tangents | None = None

    def values(self, w: Array) -> tuple[Array, Array]:
        """Return what is limited, and the torques themselves; see ``Program.values``."""
        constants = self._constants
        motion = constants.motion(self._q, self._v, w)
        values = np.empty((3, *motion.u.shape))
        torque = values[0]
        constants.torque.evaluate(motion, torque)
        torque -= self._disturbance
        values[1], values[2] = motion.q, motion.v
        self._motion, self._torque = motion, torque
        if self._tangents is not None:
            self._torque = torque.copy()
            self._tangents.replace(torque, motion)
        return values, self._torque

    def linearise(self, stages: NDArray[np.bool_]) -> None:
        """Replace the torques of some stages by their tangents; see ``Program.linearise``."""
        if self._tangents is None:
            self._tangents = Tangents(*self._torque.shape)
        new = (stages & ~self._tangents.known).nonzero()[0]
        if new.size:
            at = np.stack([part[new] for part in self._motion[2:]], axis=1)
            slopes = self._constants.torque.slopes(*at.swapaxes(0, 1))
            self._tangents.add(new, slopes, at, self._torque[new])

    def forget_tangents(self) -> None:
        """See ``Program.forget_tangents``."""
        self._tangents = None

    def scaled(self, share: float) -> TrackingProgram:
        """See ``Program.scaled``."""
        v, w_free = share * self._v, share * self.w_free
        return TrackingProgram(self._constants, self._q, v, self._disturbance, w_free, None)

    def rows(
        self, kind: NDArray[np.intp], stage: NDArray[np.intp], joint: NDArray[np.intp]
    ) -> Array:
        """Return the derivatives by w of chosen values, shape (k, n)."""
        constants = self._constants
        rows = constants.response[kind - 1, stage, joint]
        of_torque = (kind == 0).nonzero()[0]
        if of_torque.size and self._tangents is not None:
            k = stage[of_torque]
            slopes = self._tangents.slopes[k, joint[of_torque]]
            rows[of_torque] = (constants.to_middle[k] @ slopes).reshape(k.size, -1)
        return rows


class Tangents:
    """Tangents of the torques of some stages.

    Attributes:
        known: which stages have one, shape (N,).
        slopes: d tau / d [q, v, u] in the middle of each sample, shape (N, nv, 3, nv).
    """

    def __init__(self, horizon: int, nv: int) -> None:
        self.known = np.zeros(horizon, dtype=np.bool_)
        self.slopes = np.zeros((horizon, nv, 3, nv))
        self._offsets = np.zeros((horizon, nv))

    def add(self, stages: NDArray[np.intp], slopes: Array, at: Array, torque: Array) -> None:
        """Add the tangents that touch given torques.

        Args:
            stages: their stages, shape (k,).
            slopes: d tau / d [q, v, u], shape (k, nv, 3, nv).
            at: [q, v, u] where they touch, shape (k, 3, nv).
            torque: torque there, shape (k, nv) [N m].
        """
        self.known[stages], self.slopes[stages] = True, slopes
        self._offsets[stages] = torque - _times(slopes, at)

    def replace(self, torque: Array, motion: Motion) -> None:
        """Overwrite the torques (N, nv) of the stages that have a tangent by its values."""
        k = self.known.nonzero()[0]
        at = np.stack([part[k] for part in motion[2:]], axis=1)
        torque[k] = _times(self.slopes[k], at) + self._offsets[k]


def _times(slopes: Array, at: Array) -> Array:
    """Return the product of slopes (k, nv, 3, nv) and points (k, 3, nv), shape (k, nv)."""
    k, nv = slopes.shape[:2]
    product: Array = slopes.reshape(k, nv, 3 * nv) @ at.reshape(k, 3 * nv, 1)
    return product[:, :, 0]

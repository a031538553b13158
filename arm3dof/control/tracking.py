"""The default formulation: decide joint accelerations, so that the prediction is exact.

With u = q'' as the decision the prediction is a double integrator for every arm: C, F and the
Hessian are constant and are computed once. What is nonlinear, and only that, is the torque that a
stage takes, tau_k = M(q_k) u_k + C(q_k, v_k) v_k + g(q_k). It is evaluated exactly. Only where it
meets its limit does a tangent stand in for it, taken along the last plan (the real-time iteration
of Diehl, Bock and Schloeder 2005). The tangent knows how decisions before the stage move it:

    d tau_k = M du_k + d tau / dq dq_k + d tau / dv dv_k,  dq_k and dv_k linear in w.
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
from arm3dof.control.motion import MotionMap
from arm3dof.control.prediction import condense, double_integrator, quadratic_cost
from arm3dof.control.program import Tangents, sizes
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


class TrackingFormulation:
    """Builds the program of one control step from what never changes.

    Attributes:
        weights: the weights of the cost.
        hessian: H, shape (n, n).
        hessian_inverse: H^-1, shape (n, n).
        motion: from decisions to motion.
        torque: from motion to torque.
        linear: tangents of positions and velocities at stages 1..N, upper and lower limits, as
            ``LinearTangents``.
        fixed: which values no decision reaches, shape (3, N, nv); ``None`` if there is none.
        first_stages: picks each block's first stage.
        block_of_stage: which block's decisions each stage takes, the last stage twice, (N + 1,).
        to_middle: derivative of q_middle, v_middle and u of a joint by its own decisions,
            shape (N, decisions a joint, 3).
    """

    linearisations = 1

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        nv, horizon = robot.nv, settings.horizon
        self.weights = Weights(settings, nv)
        self._blocks = block_of_stage(settings)
        first = np.flatnonzero(np.diff(self._blocks, prepend=-1))
        free = first.size == horizon
        self.first_stages = slice(horizon) if free else first
        self.block_of_stage = np.append(self._blocks, self._blocks[-1])
        prediction = condense(discretise(double_integrator(nv), settings), horizon)
        cost = quadratic_cost(prediction, self.weights.Q, self.weights.R, self.weights.P)
        half = blocked(cost.H, self._blocks, nv)
        self.hessian, self.hessian_inverse = invert_hessian(blocked(half.T, self._blocks, nv))
        # w_free = -H^-1 (2 F' Q) X_free, with X_free = [e; v - v_target] of stages 0..N at u = 0
        F = blocked(prediction.F, self._blocks, nv)
        stacked = F.reshape(horizon + 1, 2 * nv, -1)
        weighed = 2 * self.weights.Q @ stacked
        weighed[-1] = 2 * self.weights.P @ stacked[-1]
        self._gain = -self.hessian_inverse @ weighed.reshape(F.shape).T
        self._state_gain = self._gain @ prediction.C
        self.motion, self.torque = MotionMap(settings), HorizonTorque(robot, settings.dt, horizon)
        self._free = self._free_response(nv)
        # where the free response has its decisions; a slice, if it can be, which is faster
        at = (5 * horizon + first)[:, np.newaxis] * nv + np.arange(nv)
        self._decided = slice(5 * horizon * nv, -nv) if free else at.ravel()
        self.to_middle = np.ascontiguousarray(self.motion.by_decision[2:].transpose(1, 2, 0))
        slopes, by_state = self.motion.slopes(nv)
        fixed = np.zeros((3, horizon, nv), dtype=np.bool_)
        fixed[1:] = ~slopes.any(axis=1).reshape(2, horizon, nv)
        self.fixed = fixed if fixed.any() else None
        self.linear = LinearTangents(slopes, by_state, self.hessian_inverse)

    def reset(self) -> None:
        """Take over the robot's masses as they are now."""
        self.torque.refresh()

    def build(
        self, state: JointState, reference: Reference, plan: Array | None, disturbance: Array
    ) -> TrackingProgram:
        """Return the program of one step; see ``Formulation.build``."""
        q, v = state.q, state.v
        if len(reference.q) == 1:
            free = self._free.dot(np.concatenate((reference.q[0], v, q, disturbance)))
            return TrackingProgram(self, q, v, disturbance, free[self._decided], plan, free)
        w_free = self._state_gain @ np.concatenate((-q, v))
        w_free += self._gain @ np.hstack([reference.q, -reference.v]).ravel()
        return TrackingProgram(self, q, v, disturbance, w_free, plan)

    def _free_response(self, nv: int) -> Array:
        """Return how what follows from w_free depends on [q_target; v; q; disturbance].

        These are the torques but for the rigid bodies', and the motion, with the last acceleration
        twice; the shape is ((6 N + 1) nv, 4 nv). One product is all that most steps need.
        """
        columns = []
        for target, v, q, disturbance in np.eye(4 * nv).reshape(-1, 4, nv):
            w_free = self._state_gain @ np.concatenate((target - q, v))
            stack = self.motion.stacked(q, v, w_free, -disturbance)
            stack[0] += self.torque.damping * stack[4]
            columns.append(np.append(stack, stack[5, -1]))
        return np.asfortranarray(np.stack(columns, axis=1))


class LinearTangents:
    """The tangents of positions and velocities, which no step changes but for where they start.

    Attributes:
        is_torque: whether a limit, by its place in ``Program.tangents``, is a torque's.
    """

    def __init__(self, slopes: Array, by_state: Array, hessian_inverse: Array) -> None:
        """Prepare the rows of all limits.

        Args:
            slopes: derivative of positions and velocities at stages 1..N by w, shape (2 N nv, n).
            by_state: their derivative by [q; v] at stage 0, shape (2 N nv, 2 nv).
            hessian_inverse: H^-1, shape (n, n).
        """
        count = len(slopes) // 2
        through = slopes @ hessian_inverse
        self._size = np.tile(sizes(slopes, through), 2)
        self._slopes, self._through, self._by_state = (
            np.vstack([rows, -rows]) / self._size[:, np.newaxis]
            for rows in (slopes, through, by_state)
        )
        self.is_torque = np.tile(np.arange(3 * count) < count, 2)
        # of a torque some row is taken, and overwritten
        self._row = np.cumsum(~self.is_torque) - 1

    def of(self, limits: NDArray[np.intp], q: Array, v: Array) -> Tangents:
        """Return the tangents of some limits; those of torques are arbitrary.

        Args:
            limits: as for ``Program.tangents``, shape (k,).
            q: positions at stage 0, shape (nv,) [rad].
            v: velocities at stage 0, shape (nv,) [rad/s].
        """
        rows = self._row.take(limits)
        slopes, through = self._slopes.take(rows, axis=0), self._through.take(rows, axis=0)
        offsets = self._by_state.take(rows, axis=0).dot(np.concatenate((q, v)))
        return Tangents(slopes, offsets, through, self._size.take(rows), exact=True)


class TrackingProgram:
    """The program of one step; see ``Program``."""

    refine = False

    def __init__(
        self,
        formulation: TrackingFormulation,
        q: Array,
        v: Array,
        disturbance: Array,
        w_free: Array,
        plan: Array | None,
        free: Array | None = None,
    ) -> None:
        """Create a program.

        Args:
            formulation: what never changes.
            q: positions at stage 0, shape (nv,) [rad].
            v: velocities at stage 0, shape (nv,) [rad/s].
            disturbance: torque that acts beside ours, shape (nv,) [N m].
            w_free: minimiser of the cost without limits, shape (n,).
            plan: accelerations of the last plan, shifted to now, shape (N, nv) [rad/s^2].
            free: torques but for the rigid bodies' and motion at w_free, one after the other, with
                the last acceleration twice, shape ((6 N + 1) nv,), if they are known already.
        """
        self.hessian, self.hessian_inverse = formulation.hessian, formulation.hessian_inverse
        self.fixed = formulation.fixed
        self.w_free, self._plan, self._free = w_free, plan, free
        self._formulation, self._q, self._v, self._disturbance = formulation, q, v, disturbance

    @property
    def start(self) -> Array | None:
        """See ``Program.start``."""
        return None if self._plan is None else self._plan[self._formulation.first_stages].ravel()

    def values(self, w: Array) -> Array:
        """See ``Program.values``; the torques are exact."""
        shared, free = self._formulation, self._free if w is self.w_free else None
        if free is None:
            stack = shared.motion.stacked(self._q, self._v, w, -self._disturbance)
            values = stack[:3]
        else:
            nv = self._q.size
            stack = free[:-nv].reshape(6, -1, nv)
            values = stack[:3].copy()
        shared.torque.add(stack[3], stack[4], stack[5], values[0], damping=free is None)
        return values

    def tangents(self, limits: NDArray[np.intp], w: Array) -> Tangents:
        """See ``Program.tangents``."""
        linear = self._formulation.linear
        tangents = linear.of(limits, self._q, self._v)
        at = linear.is_torque.take(limits).nonzero()[0]
        if not at.size:
            return tangents
        of_torques = self._torque_tangents(limits[at], w)
        for all_rows, own in zip(tangents[:-1], of_torques[:-1], strict=True):
            all_rows[at] = own
        return tangents._replace(exact=False)

    def _torque_tangents(self, limits: NDArray[np.intp], w: Array) -> Tangents:
        shared, nv = self._formulation, self._q.size
        motion = shared.motion(self._q, self._v, w)
        stages = len(motion.u)
        lower, which = np.divmod(limits, 3 * stages * nv)
        sign = 1.0 - 2.0 * lower
        stage, joint = np.divmod(which, nv)
        asked = np.zeros(stages, dtype=np.bool_)
        asked[stage] = True
        place = (asked.cumsum() - 1)[stage]
        parts = motion.q_middle, motion.v_middle, motion.u
        torque, by_motion = shared.torque.linearise(*(part[asked] for part in parts))
        by_decision = shared.to_middle[stage] @ by_motion[place, joint]
        slopes = sign[:, np.newaxis] * by_decision.reshape(limits.size, -1)
        offsets = sign * (torque - self._disturbance)[place, joint] - slopes.dot(w)
        return Tangents.scaled(slopes, offsets, self, exact=False)

    def accelerations(self, w: Array) -> Array | None:
        """See ``Program.accelerations``."""
        stages, nv = self._formulation.block_of_stage, self._q.size
        if w is self.w_free and self._free is not None:
            return self._free[-stages.size * nv :].reshape(-1, nv)
        return w.reshape(-1, nv).take(stages, axis=0)

    def gentler(self, share: float) -> TrackingProgram:
        """See ``Program.gentler``: w_free is linear in speed and way, so it shrinks with them."""
        v, w_free = share * self._v, share * self.w_free
        return TrackingProgram(self._formulation, self._q, v, self._disturbance, w_free, None)

"""Where decided accelerations take an arm: a double integrator, the same for every joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.control.formulation import block_of_stage, blocked, discretise
from arm3dof.control.prediction import condense, double_integrator
from arm3dof.control.settings import MpcSettings
from arm3dof.state import Array


class Motion(NamedTuple):
    """A motion over the horizon; every part has shape (N, nv).

    Attributes:
        q: positions at stages 1..N [rad].
        v: velocities at stages 1..N [rad/s].
        q_middle: positions in the middle of samples 0..N-1 [rad].
        v_middle: velocities in the middle of samples 0..N-1 [rad/s].
        u: accelerations in samples 0..N-1 [rad/s^2].
    """

    q: Array
    v: Array
    q_middle: Array
    v_middle: Array
    u: Array


class MotionMap:
    """The motion as a linear function of the decisions and of the state at stage 0.

    All joints move alike, so one small matrix serves them all, and one product gives the motion.

    Attributes:
        by_decision: derivative of ``Motion`` by the decisions of the same joint,
            shape (5, N, decisions a joint).
    """

    def __init__(self, settings: MpcSettings) -> None:
        horizon, dt = settings.horizon, settings.dt
        F = condense(discretise(double_integrator(1), settings), horizon).F
        error, velocity = F.reshape(horizon + 1, 2, horizon)[1:].swapaxes(0, 1)
        # the middle of a sample follows from its start exactly, however the cost is discretised
        start_velocity = np.tril(np.full((horizon, horizon), dt), -1)
        middle_velocity = start_velocity + dt / 2 * np.eye(horizon)
        position = np.vstack([np.zeros(horizon), np.cumsum(dt * middle_velocity, axis=0)[:-1]])
        middle_position = position + dt / 2 * start_velocity + dt**2 / 8 * np.eye(horizon)
        parts = (-error, velocity, middle_position, middle_velocity, np.eye(horizon))
        self.by_decision = blocked(np.stack(parts), block_of_stage(settings), 1)
        one, end = np.ones(horizon), dt * np.arange(1, horizon + 1)
        by_state = np.zeros((5, horizon, 2))
        by_state[[0, 2], :, 0] = by_state[[1, 3], :, 1] = one
        by_state[0, :, 1], by_state[2, :, 1] = end, end - dt / 2
        by_cause = np.zeros((6, horizon, self.by_decision.shape[2] + 3))
        by_cause[1:, :, :-3], by_cause[1:, :, -3:-1] = self.by_decision, by_state
        by_cause[0, :, -1] = 1.0
        self._by_state = by_state
        self._by_cause = np.asfortranarray(by_cause.reshape(6 * horizon, -1))  # faster to multiply

    def __call__(self, q: Array, v: Array, w: Array) -> Motion:
        """Return a motion.

        Args:
            q: positions at stage 0, shape (nv,) [rad].
            v: velocities at stage 0, shape (nv,) [rad/s].
            w: decisions, those of all joints together for each block, shape (n,) [rad/s^2].
        """
        return Motion(*self.stacked(q, v, w, np.zeros(q.size))[1:])

    def slopes(self, nv: int) -> tuple[Array, Array]:
        """Return the derivatives of positions and velocities at stages 1..N of all joints.

        Args:
            nv: number of joints.

        Returns:
            That by the decisions, shape (2 N nv, n), and that by [q; v] at stage 0, (2 N nv, 2 nv).
        """
        both = []
        for of_a_joint in (self.by_decision[:2], self._by_state[:2]):
            slopes = np.einsum("ckb,ij->ckibj", of_a_joint, np.eye(nv))
            both.append(np.ascontiguousarray(slopes).reshape(slopes[..., 0, 0].size, -1))
        return both[0], both[1]

    def stacked(self, q: Array, v: Array, w: Array, first: Array) -> Array:
        """Return the parts of a motion after one that is the same at all stages, (6, N, nv).

        Args:
            q: positions at stage 0, shape (nv,) [rad].
            v: velocities at stage 0, shape (nv,) [rad/s].
            w: decisions, shape (n,) [rad/s^2].
            first: what the first part repeats, shape (nv,).
        """
        causes = np.concatenate((w, q, v, first)).reshape(-1, q.size)
        return np.asarray(self._by_cause.dot(causes).reshape(6, -1, q.size))

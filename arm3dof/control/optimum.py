"""The solution of a control step's program, with all that proves it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.program import Bounds, Program
from arm3dof.control.qp import UNBOUNDED, QpStatus, QuadraticProgram
from arm3dof.state import Array

TORQUE, RATE = 0, 3  # kinds of limits; 1 and 2 are positions and velocities


class Optimum(NamedTuple):
    """The solution of a program.

    Attributes:
        w: decisions, shape (n,).
        values: what is limited, shape (kinds, N, nv); see ``limited``.
        torque_error: largest error of a tangent that stands in for a torque, as a share of the
            torque's limit.
        status: how the solve ended.
        softened: whether a velocity or joint limit is exceeded.
        rows: the limits that were considered, as a mask, shape (2, kinds, N, nv): upper, lower.
        multipliers: z of these limits, in the mask's order.
        program: the program that was solved.
        bounds: its limits.
    """

    w: Array
    values: Array
    torque_error: float
    status: QpStatus
    softened: bool
    rows: NDArray[np.bool_]
    multipliers: Array
    program: Program
    bounds: Bounds

    @property
    def tau(self) -> Array:
        """Torques of stages 0..N-1, shape (N, nv) [N m]."""
        return np.asarray(self.values[TORQUE])

    @property
    def states(self) -> Array:
        """Positions and velocities of stages 1..N, shape (2, N, nv) [rad, rad/s]."""
        return self.values[1:3]

    @property
    def active(self) -> NDArray[np.bool_]:
        """The limits that push, as a mask like ``rows``."""
        active = np.zeros_like(self.rows)
        active[self.rows] = self.multipliers > _IDLE * self.multipliers.max(initial=0.0)
        return active

    def kkt_residual(self) -> float:
        """Return the largest violation of the optimality conditions of the linearised program.

        Stationarity, feasibility of the hard limits, and complementarity: z is zero off the limit
        and, for a soft limit, its full price beyond the limit.
        """
        program, bounds = self.program, self.bounds
        C, _ = signed_rows(program, self.rows)
        gradient = program.hessian @ (self.w - program.w_free) + C.T @ self.multipliers
        excess = excess_of(self.values, bounds)
        excess[:, 1:3] = np.where(program.reached, excess[:, 1:3], 0.0)
        price = np.broadcast_to(bounds.price[:, np.newaxis, np.newaxis], excess.shape)[self.rows]
        inside, outside = -excess[self.rows].clip(max=0.0), excess[self.rows].clip(min=0.0)
        unpaid = np.where(price < UNBOUNDED, 1 - self.multipliers / price, 1.0)
        parts = (gradient, self.multipliers * inside, outside * unpaid, excess[~self.rows].clip(0))
        return max(float(np.abs(part).max(initial=0.0)) for part in parts)

    def quadratic_program(self) -> QuadraticProgram:
        """Return the program as one QP in w, with every limit that a decision reaches, and hard.

        Torques without a tangent take the one at the optimum. Where its limits can all be kept,
        the QP's optimum is the program's.
        """
        program, bounds = self.program, self.bounds
        program.values(self.w)
        program.linearise(np.ones(self.rows.shape[2], dtype=np.bool_))
        rows = np.ones_like(self.rows[:1])
        rows[:, 1:3] &= program.reached
        C, _ = signed_rows(program, rows)
        at_zero = self.values[rows[0]] - C @ self.w
        low, high = (
            np.broadcast_to(side, rows[0].shape)[rows[0]] - at_zero
            for side in (bounds.low, bounds.high)
        )
        return QuadraticProgram(program.hessian, -program.hessian @ program.w_free, C, low, high)


def limited(program: Program, w: Array, bounds: Bounds) -> tuple[Array, float]:
    """Return all that is limited, shape (kinds, N, nv), and the largest error of a tangent.

    The kinds are torque, position, velocity and, if it is limited, the change of torque.
    """
    values, torque = program.values(w)
    error = float((np.abs(torque - values[TORQUE]) / bounds.most[TORQUE]).max())
    if len(bounds.high) > RATE:
        change = np.diff(values[TORQUE], axis=0, prepend=bounds.last_torque[np.newaxis])
        values = np.concatenate([values, change[np.newaxis]])
    return values, error


def excess_of(values: Array, bounds: Bounds) -> Array:
    """Return by how much values are above their upper and below their lower limit."""
    excess = np.empty((2, *values.shape))
    np.subtract(values, bounds.high, out=excess[0])
    np.subtract(bounds.low, values, out=excess[1])
    return excess


def signed_rows(program: Program, rows: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """Return the chosen rows of C, so that a limit reads C w <= b, and the kind of each."""
    side, kind, stage, joint = np.nonzero(rows)
    is_rate = kind == RATE
    C = program.rows(np.where(is_rate, TORQUE, kind), stage, joint)
    if is_rate.any():
        at, j = stage[is_rate], joint[is_rate]
        before = program.rows(np.zeros_like(at), np.maximum(at - 1, 0), j)
        C[is_rate] -= before * (at > 0)[:, np.newaxis]
    C[side == 1] *= -1.0
    return C, kind


def torque_stages(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the stages whose torques are in some rows, as a mask, shape (N,)."""
    stages: NDArray[np.bool_] = np.asarray(rows[:, TORQUE].any(axis=(0, 2)))
    if rows.shape[1] > RATE:
        changes = np.asarray(rows[:, RATE].any(axis=(0, 2)))
        stages |= changes
        stages[:-1] |= changes[1:]
    return stages


_IDLE = 1e-9  # a multiplier below this share of the largest did not matter

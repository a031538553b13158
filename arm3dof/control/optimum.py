"""The solution of a control step's program, with all that proves it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.bounds import POSITION, TORQUE, VELOCITY, Bounds
from arm3dof.control.program import Program
from arm3dof.control.qp import UNBOUNDED, QpStatus, QuadraticProgram
from arm3dof.control.working_set import WorkingSet
from arm3dof.state import Array


class Optimum(NamedTuple):
    """The solution of a program.

    Attributes:
        w: decisions, shape (n,).
        values: what is limited, shape (kinds, N, nv): torques, positions, velocities and, if they
            are limited, changes of torque; by its tangent where it is in the working set.
        status: how the solve ended.
        softened: whether a velocity or joint limit is exceeded.
        working: the limits that were considered.
        multipliers: z of the working set's rows.
        torque_error: largest error of a tangent that stands in for a torque, as a share of the
            torque's limit.
        program: the program that was solved.
        bounds: its limits.
    """

    w: Array
    values: Array
    status: QpStatus
    softened: bool
    working: WorkingSet
    multipliers: Array
    torque_error: float
    program: Program
    bounds: Bounds

    @property
    def tau(self) -> Array:
        """Torques of stages 0..N-1, shape (N, nv) [N m]."""
        return np.asarray(self.values[TORQUE])

    @property
    def states(self) -> Array:
        """Positions and velocities of stages 1..N, shape (2, N, nv) [rad, rad/s]."""
        return self.values[POSITION : VELOCITY + 1]

    @property
    def rows(self) -> NDArray[np.bool_]:
        """The limits that were considered, as a mask, shape (2, kinds, N, nv), upper and lower."""
        rows = np.zeros((2, *self.values.shape), dtype=np.bool_)
        rows.ravel()[self.working.limits] = True
        return rows

    def kkt_residual(self) -> float:
        """Return the largest violation of the optimality conditions, tangents being believed.

        Stationarity, feasibility of the hard limits, and complementarity: z is zero off the limit
        and, for a soft limit, its full price beyond the limit.
        """
        working, z = self.working, self.multipliers
        gradient = self.program.hessian @ (self.w - self.program.w_free) + working.C.T @ z
        z, slack = z / working.size, working.slack(self.w)
        price = self.bounds.prices[working.limits]
        unpaid = np.where(price < UNBOUNDED, 1 - z / price, 1.0)
        others = self.bounds.excess(self.values)
        if self.program.fixed is not None:
            others[:, : VELOCITY + 1][:, self.program.fixed] = 0.0
        others.ravel()[working.limits] = 0.0
        parts = (gradient, z * slack.clip(min=0.0), unpaid * slack.clip(max=0.0), others.clip(0.0))
        return max(float(np.abs(part).max(initial=0.0)) for part in parts)

    def quadratic_program(self) -> QuadraticProgram:
        """Return the program as one QP in w, with every limit that a decision reaches, and hard.

        Torques outside the working set have their tangents at the optimum. Where its limits can
        all be kept, the QP's optimum is the program's.
        """
        program, bounds, count = self.program, self.bounds, self.values.size
        every = np.arange(count)
        C, at_zero = WorkingSet.of(program, bounds, every, self.w).affine()
        lower, which = np.divmod(self.working.limits, count)
        sign = 1.0 - 2.0 * lower
        own, own_at_zero = self.working.affine()
        C[which] = sign[:, np.newaxis] * own
        at_zero[which] = sign * own_at_zero
        reached = C.any(axis=1)
        low, high = bounds.low.ravel() - at_zero, bounds.high.ravel() - at_zero
        gradient = -program.hessian @ program.w_free
        return QuadraticProgram(program.hessian, gradient, C[reached], low[reached], high[reached])

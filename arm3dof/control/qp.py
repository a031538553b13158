"""Convex quadratic programs, solved by ProxQP in workspaces that are kept between solves."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from proxsuite import proxqp

from arm3dof.errors import InputError
from arm3dof.state import Array

UNBOUNDED = 1e20
"""A bound of this size or more is no bound (ProxQP's convention)."""

_INNER_ITERATIONS = 20


class QuadraticProgram(NamedTuple):
    """Minimise 1/2 x' H x + g' x subject to lower <= C x <= upper.

    Attributes:
        H: Hessian, symmetric positive semidefinite, shape (n, n).
        g: gradient at zero, shape (n,).
        C: constraint rows, shape (m, n).
        lower: bounds, shape (m,); ``-UNBOUNDED`` for none.
        upper: bounds, shape (m,); ``UNBOUNDED`` for none.
    """

    H: Array
    g: Array
    C: Array
    lower: Array
    upper: Array


class QpStatus(Enum):
    """How a solve ended; the value is a sentence for people."""

    SOLVED = "solved to the tolerance"
    ITERATION_LIMIT = "the iteration cap was reached before the tolerance"
    INFEASIBLE = "no point satisfies every constraint"
    UNBOUNDED = "the cost has no lower bound inside the constraints"
    NOT_FINITE = "the problem or its solution holds NaN or infinity"


SOLVED = QpStatus.SOLVED
"""The same, read ten times faster: every control step asks for it several times."""

_STATUS = {
    proxqp.PROXQP_SOLVED: QpStatus.SOLVED,
    proxqp.PROXQP_MAX_ITER_REACHED: QpStatus.ITERATION_LIMIT,
    proxqp.PROXQP_NOT_RUN: QpStatus.ITERATION_LIMIT,
    proxqp.PROXQP_PRIMAL_INFEASIBLE: QpStatus.INFEASIBLE,
    proxqp.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE: QpStatus.INFEASIBLE,
    proxqp.PROXQP_DUAL_INFEASIBLE: QpStatus.UNBOUNDED,
}


@dataclass(frozen=True)
class QpSettings:
    """Accuracy and effort of a solve.

    Attributes:
        tolerance: largest absolute residual and duality gap of a solved problem.
        max_iterations: cap on the solver's outer iterations; each has at most 20 inner ones, so
            that the time of a solve is bounded whatever the problem.

    Raises:
        InputError: a value is not positive.
    """

    tolerance: float = 1e-8
    max_iterations: int = 40

    def __post_init__(self) -> None:
        if not self.tolerance > 0:
            raise InputError(f"tolerance is {self.tolerance}; give a positive number")
        if not self.max_iterations >= 1:
            raise InputError(f"max_iterations is {self.max_iterations}; give 1 or more")

    @property
    def most_steps(self) -> int:
        """Cap on the inner iterations in all."""
        return self.max_iterations * _INNER_ITERATIONS


@dataclass(frozen=True, eq=False)
class QpSolution:
    """What a solve returned.

    Attributes:
        x: primal point, shape (n,).
        z: multipliers of the rows, shape (m,); positive where the upper bound pushes.
        status: how the solve ended.
        solve_time: wall time of update and solve [s].
    """

    x: Array
    z: Array
    status: QpStatus
    solve_time: float

    def kkt_residual(self, qp: QuadraticProgram) -> float:
        """Return the largest violation of the optimality conditions of ``qp``.

        It is the greatest of: the gradient of the Lagrangian, the distance of ``C x`` from its
        bounds, and each multiplier times the distance of its row from the bound that it claims.
        """
        stationarity = qp.H @ self.x + qp.g + qp.C.T @ self.z
        rows = qp.C @ self.x
        infeasibility = np.maximum(qp.lower - rows, rows - qp.upper).clip(min=0.0)
        to_upper = np.where(self.z > 0, self.z * (qp.upper - rows), 0.0)
        to_lower = np.where(self.z < 0, self.z * (rows - qp.lower), 0.0)
        parts = (stationarity, infeasibility, to_upper, to_lower)
        return max((float(np.abs(part).max()) for part in parts if part.size), default=0.0)


class ProxqpWorkspace:
    """One ProxQP object, reused for problems of one size.

    After a solve that did not end as ``SOLVED`` the object is built anew, so that a bad problem
    leaves no trace in the next one.
    """

    def __init__(self, n: int, m: int, settings: QpSettings | None = None) -> None:
        self._n, self._m = n, m
        self._settings = settings or QpSettings()
        self._qp: proxqp.dense.QP | None = None

    def reset(self) -> None:
        """Forget the previous solution."""
        self._qp = None

    def solve(self, qp: QuadraticProgram, *, same_hessian: bool = False) -> QpSolution:
        """Solve one problem, starting from the previous one's solution.

        Args:
            qp: the problem, with n variables and m rows.
            same_hessian: promise that ``qp.H`` equals the previous problem's, which saves time.

        Raises:
            InputError: the problem has another size than the workspace.
        """
        if qp.g.shape != (self._n,) or qp.C.shape != (self._m, self._n):
            raise InputError(
                f"the QP has {qp.C.shape[0]} rows and {qp.g.size} variables; "
                f"this workspace takes {self._m} and {self._n}"
            )
        start = time.perf_counter()
        if not all(np.isfinite(part).all() for part in qp):
            return broken(self._n, self._m, start)
        if self._qp is None:
            self._qp = _solver(self._n, self._m, self._settings)
            self._qp.init(qp.H, qp.g, None, None, qp.C, qp.lower, qp.upper)
        elif same_hessian:
            self._qp.update(g=qp.g, C=qp.C, l=qp.lower, u=qp.upper)
        else:
            self._qp.update(
                H=qp.H, g=qp.g, C=qp.C, l=qp.lower, u=qp.upper, update_preconditioner=True
            )
        self._qp.solve()
        solution = _solution(self._qp.results, start)
        if solution.status is not QpStatus.SOLVED:
            self.reset()
        return solution


def solve_once(
    H: Array, g: Array, u: Array, x: Array, z: Array, settings: QpSettings
) -> QpSolution:
    """Minimise 1/2 x' H x + g' x subject to 0 <= x <= u, by a ProxQP object of its own.

    Args:
        H: Hessian with a diagonal of about 1, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        x: where to start, shape (n,).
        z: multipliers to start with, shape (n,).
        settings: accuracy and effort.
    """
    start, n = time.perf_counter(), g.size
    solver = _solver(n, n, settings)
    solver.settings.compute_preconditioner = False
    solver.settings.initial_guess = proxqp.InitialGuess.WARM_START
    solver.init(H, g, None, None, np.eye(n), np.zeros(n), u)
    solver.solve(x, None, z)
    return _solution(solver.results, start)


def _solver(n: int, m: int, settings: QpSettings) -> proxqp.dense.QP:
    dense = proxqp.dense
    backend = dense.DenseBackend.PrimalDualLDLT
    qp = dense.QP(n, 0, m, False, dense.HessianType.Dense, backend)
    qp.settings.eps_abs = settings.tolerance
    qp.settings.eps_rel = 0.0
    qp.settings.check_duality_gap = True  # without it a few "solved" points are not optimal
    qp.settings.eps_duality_gap_abs = settings.tolerance
    qp.settings.eps_duality_gap_rel = 0.0
    qp.settings.eps_primal_inf = 1e-8  # the default calls some feasible problems infeasible
    qp.settings.max_iter = settings.max_iterations
    qp.settings.max_iter_in = _INNER_ITERATIONS
    qp.settings.default_mu_in = 1e-3  # measured: half the time of the default on our problems
    qp.settings.initial_guess = proxqp.InitialGuess.COLD_START_WITH_PREVIOUS_RESULT
    return qp


def _solution(results: proxqp.dense.Results, start: float) -> QpSolution:
    x, z = np.array(results.x), np.array(results.z)
    if not (np.isfinite(x).all() and np.isfinite(z).all()):
        return broken(x.size, z.size, start)
    return QpSolution(x, z, _STATUS[results.info.status], time.perf_counter() - start)


def broken(n: int, m: int, start: float) -> QpSolution:
    """Return what became of a problem that holds NaN or infinity.

    Args:
        n: number of variables.
        m: number of rows.
        start: reading of ``time.perf_counter`` when its solve began [s].
    """
    x, z = np.full(n, np.nan), np.full(m, np.nan)
    return QpSolution(x, z, QpStatus.NOT_FINITE, time.perf_counter() - start)

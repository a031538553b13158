"""Convex quadratic programs, solved by ProxQP in workspaces that are kept between solves."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from proxsuite import proxqp

from arm3dof.errors import InputError
from arm3dof.state import Array

UNBOUNDED = 1e20
"""A bound of this size or more is no bound (ProxQP's convention)."""

_INNER_ITERATIONS = 20
_SAME = 1e-5  # relative difference up to which a solution is made exact
_ROUNDS = 8  # in which a guess is made better
_ABSURD = 1e8  # a larger guess comes from rows that are nearly dependent


class QuadraticProgram(NamedTuple):
    """Minimise 1/2 x' H x + g' x subject to l <= C x <= u.

    Attributes:
        H: Hessian, symmetric positive semidefinite, shape (n, n).
        g: gradient at zero, shape (n,).
        C: constraint rows, shape (m, n).
        l: lower bounds, shape (m,); ``-UNBOUNDED`` for none.
        u: upper bounds, shape (m,); ``UNBOUNDED`` for none.
    """

    H: Array
    g: Array
    C: Array
    l: Array  # noqa: E741 - the field's standard name, beside its partner u
    u: Array


class QpStatus(Enum):
    """How a solve ended; the value is a sentence for people."""

    SOLVED = "solved to the tolerance"
    ITERATION_LIMIT = "the iteration cap was reached before the tolerance"
    INFEASIBLE = "no point satisfies every constraint"
    UNBOUNDED = "the cost has no lower bound inside the constraints"
    NOT_FINITE = "the problem or its solution holds NaN or infinity"


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


@dataclass(frozen=True, eq=False)
class QpSolution:
    """What a solve returned.

    Attributes:
        x: primal point, shape (n,).
        z: multipliers of the rows, shape (m,); positive where the upper bound pushes.
        status: how the solve ended.
        iterations: outer iterations used.
        solve_time: wall time of update and solve [s].
    """

    x: Array
    z: Array
    status: QpStatus
    iterations: int
    solve_time: float

    def kkt_residual(self, qp: QuadraticProgram) -> float:
        """Return the largest violation of the optimality conditions of ``qp``.

        It is the greatest of: the gradient of the Lagrangian, the distance of ``C x`` from its
        bounds, and each multiplier times the distance of its row from the bound that it claims.
        """
        stationarity = qp.H @ self.x + qp.g + qp.C.T @ self.z
        rows = qp.C @ self.x
        infeasibility = np.maximum(qp.l - rows, rows - qp.u).clip(min=0.0)
        to_upper = np.where(self.z > 0, self.z * (qp.u - rows), 0.0)
        to_lower = np.where(self.z < 0, self.z * (rows - qp.l), 0.0)
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
            return _broken(self._n, self._m, start)
        if self._qp is None:
            self._qp = _solver(self._n, self._m, self._settings)
            self._qp.init(qp.H, qp.g, None, None, qp.C, qp.l, qp.u)
        elif same_hessian:
            self._qp.update(g=qp.g, C=qp.C, l=qp.l, u=qp.u)
        else:
            self._qp.update(H=qp.H, g=qp.g, C=qp.C, l=qp.l, u=qp.u, update_preconditioner=True)
        self._qp.solve()
        results = self._qp.results
        x, z = np.array(results.x), np.array(results.z)
        status, iterations = _STATUS[results.info.status], int(results.info.iter)
        if not (np.isfinite(x).all() and np.isfinite(z).all()):
            self.reset()
            return _broken(self._n, self._m, start)
        if status is not QpStatus.SOLVED:
            self.reset()
        return QpSolution(x, z, status, iterations, time.perf_counter() - start)


class BoxWorkspace:
    """ProxQP objects for problems min 1/2 x' H x + g' x, 0 <= x <= u, one for each size.

    Each solve starts from a guess of which variables are inside their bounds, improved by the
    primal-dual active set method (Hintermueller, Ito and Kunisch 2003). If it is right ProxQP has
    only to confirm it. An object remembers nothing from one solve to the next.
    """

    def __init__(self, settings: QpSettings | None = None) -> None:
        self._settings = settings or QpSettings()
        self._solvers: dict[int, proxqp.dense.QP] = {}

    def solve(self, H: Array, g: Array, u: Array, inside: NDArray[np.bool_]) -> QpSolution:
        """Solve one problem.

        Args:
            H: Hessian with a diagonal of about 1, shape (n, n).
            g: gradient at zero, shape (n,).
            u: upper bounds, shape (n,).
            inside: which variables are guessed to be inside their bounds, shape (n,).
        """
        start, n = time.perf_counter(), g.size
        if not math.isfinite(float(H.sum()) + float(g.sum())):
            return _broken(n, n, start)
        solver = self._solvers.get(n)
        if solver is None:
            solver = self._solvers[n] = _solver(n, n, self._settings)
            solver.settings.compute_preconditioner = False
            solver.settings.initial_guess = proxqp.InitialGuess.WARM_START
            solver.init(H, g, None, None, np.eye(n), np.zeros(n), u)
        else:
            solver.update(H=H, g=g, u=u)
        x, z = _guess(H, g, u, inside)
        solver.solve(x, None, z)
        info = solver.results.info
        status, iterations = _STATUS[info.status], int(info.iter)
        if status is not QpStatus.SOLVED:
            del self._solvers[n]
        if iterations > 0:
            x, z = solver.results.x, solver.results.z
            if not (np.isfinite(x).all() and np.isfinite(z).all()):
                return _broken(n, n, start)
            exact, pull = _from_sets(H, g, u, z == 0.0, z > 0.0)
            if np.abs(exact - x).max() <= _SAME * max(float(np.abs(x).max()), 1.0):
                x, z = exact, pull  # the sets are known, and with them every digit
        return QpSolution(x, z, status, iterations, time.perf_counter() - start)


def _guess(H: Array, g: Array, u: Array, inside: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return x and the bounds' multipliers as they follow from a guess, made better in rounds.

    If the rounds do not settle the first guess is moved into the bounds.
    """
    upper = np.zeros_like(inside)
    first, z = _from_sets(H, g, u, inside, upper)
    if inside.all() and first.min() >= 0.0 and (first <= u).all():
        return first, z
    x = first
    for _ in range(_ROUNDS):
        above, below = x > u, x < 0.0
        new_upper = np.where(inside, above, upper & (z >= 0.0))
        new_inside = np.where(inside, ~(above | below), np.where(upper, z < 0.0, z > 0.0))
        if (new_inside == inside).all() and (new_upper == upper).all():
            return x, z
        inside, upper = new_inside, new_upper
        x, z = _from_sets(H, g, u, inside, upper)
    x = np.minimum(np.maximum(first, 0.0), u)
    if not x.max() < _ABSURD:
        x = np.zeros_like(g)
    pull = H @ x + g
    z = np.where(x <= 0.0, -np.maximum(pull, 0.0), np.where(x >= u, np.maximum(-pull, 0.0), 0.0))
    return x, z


def _from_sets(
    H: Array, g: Array, u: Array, inside: NDArray[np.bool_], upper: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return x and the bounds' multipliers if it is known which variables are at which bound.

    Args:
        H: Hessian, shape (n, n).
        g: gradient at zero, shape (n,).
        u: upper bounds, shape (n,).
        inside: which variables are inside, shape (n,).
        upper: which are at their upper bounds, shape (n,); the others are at zero.
    """
    try:
        if inside.all():
            return np.asarray(np.linalg.solve(H, -g)), np.zeros_like(g)
        x = np.where(upper, u, 0.0)
        k = inside.nonzero()[0]
        x[k] = np.linalg.solve(H[k[:, np.newaxis], k], -g[k] - H[k] @ x)
    except np.linalg.LinAlgError:  # such sets cannot be right
        return np.zeros_like(g), np.zeros_like(g)
    z = -(H @ x + g)
    z[k] = 0.0
    return x, z


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


def _broken(n: int, m: int, start: float) -> QpSolution:
    x, z = np.full(n, np.nan), np.full(m, np.nan)
    return QpSolution(x, z, QpStatus.NOT_FINITE, 0, time.perf_counter() - start)

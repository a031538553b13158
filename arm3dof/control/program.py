"""The constrained program of one control step, solved so that it always has an answer.

Torque limits are hard: tau is ours to choose. Velocity and joint limits are soft, with an exact
penalty: they are kept whenever the torque can keep them, and left as little as possible when it
cannot, so the program is always feasible. Few of them matter at any time, so the program is
solved with the torque limits alone; the limits that its solution would break are added, until
none is broken. The result is the optimum of the program with all limits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.control.qp import UNBOUNDED, ProxqpWorkspace, QpSettings, QpSolution, QpStatus
from arm3dof.control.qp import QuadraticProgram as Qp
from arm3dof.model.robot import Limits
from arm3dof.state import Array

_LIMIT_TOLERANCE = 1e-6  # [rad, rad/s]: below this a limit is kept
_KKT_TOLERANCE = 1e-6
_ROWS_AT_A_TIME = 8  # workspaces grow in steps of this many soft rows


class Program(NamedTuple):
    """Cost, prediction and torque of one control step, as functions of U.

    Attributes:
        H: Hessian of the cost, shape (n, n).
        g: gradient of the cost at U = 0, shape (n,).
        torque_gain: d tau_k / d u_k, shape (N, nv, nv) [kg m^2].
        torque_offset: tau_k at u_k = 0, without Coulomb friction, shape (N, nv) [N m].
        free_response: X at U = 0, shape ((N + 1) 2 nv,) [rad, rad/s].
        response: dX / dU, shape ((N + 1) 2 nv, n).
    """

    H: Array
    g: Array
    torque_gain: Array
    torque_offset: Array
    free_response: Array
    response: Array


class Optimum(NamedTuple):
    """The solution of a program.

    Attributes:
        u: inputs of all stages, shape (N, nv) [rad/s^2].
        x: predicted states [e; v] of stages 0..N, shape (N + 1, 2 nv) [rad, rad/s].
        softened: whether a velocity or joint limit is exceeded.
        qp: the last QP that was solved.
        solution: its solution.
    """

    u: Array
    x: Array
    softened: bool
    qp: Qp
    solution: QpSolution


class ProgramSolver:
    """Solves the programs of one controller, keeping the solver's memory between steps."""

    def __init__(self, limits: Limits, limit_weight: float, settings: QpSettings) -> None:
        self._limits, self._limit_weight, self._settings = limits, limit_weight, settings
        self._workspaces: dict[tuple[int, int], ProxqpWorkspace] = {}

    def reset(self) -> None:
        """Forget earlier solutions."""
        self._workspaces.clear()

    def solve(self, program: Program, q_target: Array, tau_max: Array) -> Optimum:
        """Return the optimum of a program.

        Args:
            program: the program.
            q_target: target that the program's error refers to, shape (nv,) [rad].
            tau_max: torque limit, Coulomb friction taken off, shape (nv,) [N m].
        """
        qp = _torque_limited(program, tau_max)
        solution = self._workspace(qp).solve(qp)
        rows, bounds = _limit_rows(program, self._limits, q_target)
        chosen = np.zeros(bounds.size, dtype=bool)
        softened = False
        while solution.status is QpStatus.SOLVED:
            excess = rows @ solution.x[: program.g.size] - bounds
            broken = (excess > _LIMIT_TOLERANCE) & ~chosen
            softened = bool((excess[chosen] > _LIMIT_TOLERANCE).any())
            if not broken.any():
                break
            chosen |= broken
            qp = _softened(program, qp, rows[chosen], bounds[chosen], self._limit_weight)
            solution = self._certified(qp)
        nv = tau_max.size
        U = solution.x[: program.g.size]
        X = program.free_response + program.response @ U
        return Optimum(U.reshape(-1, nv), X.reshape(-1, 2 * nv), softened, qp, solution)

    def _certified(self, qp: Qp) -> QpSolution:
        """Solve a QP; from scratch if the start from an earlier solution misled the solver."""
        workspace = self._workspace(qp)
        solution = workspace.solve(qp)
        if solution.status is not QpStatus.SOLVED or solution.kkt_residual(qp) > _KKT_TOLERANCE:
            workspace.reset()
            solution = workspace.solve(qp)
        return solution

    def _workspace(self, qp: Qp) -> ProxqpWorkspace:
        size = (qp.g.size, qp.l.size)
        if size not in self._workspaces:
            self._workspaces[size] = ProxqpWorkspace(*size, self._settings)
        return self._workspaces[size]


def _torque_limited(program: Program, tau_max: Array) -> Qp:
    """Return the QP whose rows are |gain u + offset| <= tau_max at every stage."""
    stages, nv = program.torque_offset.shape
    rows = np.zeros((stages, nv, stages, nv))
    each = np.arange(stages)
    rows[each, :, each, :] = program.torque_gain
    low = (-tau_max - program.torque_offset).ravel()
    high = (tau_max - program.torque_offset).ravel()
    return Qp(program.H, program.g, rows.reshape(stages * nv, -1), low, high)


def _limit_rows(program: Program, limits: Limits, q_target: Array) -> tuple[Array, Array]:
    """Return every velocity and joint limit of stages 1..N as rows @ U <= bounds."""
    nv = q_target.size
    response = program.response.reshape(-1, 2, nv, program.g.size)[1:]
    free = program.free_response.reshape(-1, 2, nv)[1:]
    d_error, d_velocity = response[:, 0], response[:, 1]
    error, velocity = free[:, 0], free[:, 1]
    rows = np.concatenate([d_velocity, -d_velocity, -d_error, d_error])
    bounds = np.concatenate(
        [
            limits.v_max - velocity,
            limits.v_max + velocity,
            limits.q_max - q_target + error,
            q_target - limits.q_min - error,
        ]
    )
    return rows.reshape(-1, program.g.size), bounds.ravel()


def _softened(program: Program, base: Qp, rows: Array, bounds: Array, limit_weight: float) -> Qp:
    """Add soft rows to a QP, each with a slack of its own that is priced linearly.

    The number of slacks is rounded up, so that few sizes of workspace are needed; a slack without
    a row rests at zero.
    """
    n, wanted = program.g.size, bounds.size
    slacks = -(-wanted // _ROWS_AT_A_TIME) * _ROWS_AT_A_TIME
    torque_rows = program.torque_offset.size
    H = np.zeros((n + slacks, n + slacks))
    H[:n, :n] = program.H
    H[n:, n:] = np.eye(slacks)
    g = np.concatenate([program.g, np.full(slacks, limit_weight)])
    C = np.zeros((torque_rows + 2 * slacks, n + slacks))
    C[:torque_rows, :n] = base.C[:torque_rows, :n]
    C[torque_rows : torque_rows + wanted, :n] = rows
    C[torque_rows : torque_rows + slacks, n:] = -np.eye(slacks)
    C[torque_rows + slacks :, n:] = np.eye(slacks)
    low = np.concatenate([base.l[:torque_rows], np.full(slacks, -UNBOUNDED), np.zeros(slacks)])
    padded = np.full(slacks, UNBOUNDED)
    padded[:wanted] = bounds
    high = np.concatenate([base.u[:torque_rows], padded, np.full(slacks, UNBOUNDED)])
    return Qp(H, g, C, low, high)

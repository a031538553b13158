"""Solves the program of a control step, looking only at the few limits that matter.

It is solved in its dual, over one multiplier z >= 0 for each limit:

    w = w_free - H^-1 C' z,   z = argmin 1/2 z' (C H^-1 C') z - (C w_free - b)' z,   z <= price,

with w_free = -H^-1 g. A soft limit differs from a hard one in nothing but its price. Few limits
matter at any time: those that the solution would break are added until none is broken, and those of
the last step are tried first. What comes out is the optimum of the program with all limits; without
an active limit it is w_free, at the cost of one matrix product.

Torques that are nonlinear in w take part by their tangents at the last plan. Without one the
optimum is followed from where it is easy: an arm at rest on its target. Speed, way to the target
and prices then grow to what they are, in a few steps, each with the last one's plan (numerical
continuation, Allgower and Georg 1990).
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.optimum import Optimum, excess_of, limited, signed_rows, torque_stages
from arm3dof.control.program import Bounds, Program
from arm3dof.control.qp import (
    UNBOUNDED,
    ProxqpWorkspace,
    QpSettings,
    QpStatus,
    QuadraticProgram,
)
from arm3dof.state import Array

_MOST_ROUNDS = 8
_MOST_ROWS = 3.0  # limits a decision; with more, braking is the better answer
_MOST_WORK = 10.0  # duals with as many limits as decisions, in one control step
_PATIENCE = 3  # after so many rounds a joint's limit is added for all stages at once
_TORQUE_ERROR = 0.1  # a tangent that errs by more of its limit is taken anew, ...
_MOST_TANGENTS = 3  # ... so often in a step
_FIRST_SHARE = 1 / 6  # of the way to the target, in the first step of the continuation
_LEAST_STEP = 1 / 40
_COLD_TORQUE_ERROR = 1e-4  # without a last plan there is no next step that would mend an error
_MOST_COLD_TANGENTS = 8


class ProgramSolver:
    """Solves the programs of one controller, trying first the limits that mattered last."""

    def __init__(self, settings: QpSettings) -> None:
        self._settings = settings
        self._workspaces: dict[int, ProxqpWorkspace] = {}
        self._likely: NDArray[np.bool_] | None = None
        self.begin(None)

    def begin(self, deadline: float | None) -> None:
        """Begin a control step, whose work is bounded.

        Args:
            deadline: reading of ``time.perf_counter`` from which on no more duals are solved [s];
                one that has begun is solved to its end.
        """
        self._deadline, self._work = deadline, 0.0

    def reset(self) -> None:
        """Forget earlier solutions."""
        self._workspaces.clear()
        self._likely = None

    def advance(self) -> None:
        """Move what is remembered one stage ahead, to the next control step."""
        if self._likely is not None:
            self._likely[:, :, :-1] = self._likely[:, :, 1:]

    def solve(self, program: Program, bounds: Bounds) -> Optimum:
        """Return the optimum of a program."""
        values, _ = limited(program, program.w_free, bounds)
        kept = (values <= bounds.most) & (values >= bounds.least)
        if kept.all():
            self._likely = None
            return _free_optimum(program, bounds, values, QpStatus.SOLVED)
        if not np.isfinite(values).all():
            return _free_optimum(program, bounds, values, QpStatus.NOT_FINITE)
        free = np.ones((2, *values.shape), dtype=np.bool_)
        free[:, 1:3] = program.reached
        if not (~kept & free[0]).any():  # what is broken, no decision can mend
            optimum = _free_optimum(program, bounds, values, QpStatus.SOLVED)
            return optimum._replace(softened=True)
        start = program.start
        if start is None:
            optimum = self._continue(program, bounds, free)
        else:
            rows = np.zeros_like(free)
            if self._likely is not None and self._likely.shape == rows.shape:
                rows |= self._likely & free
            optimum = self._retouch(
                program, bounds, free, start, rows, _TORQUE_ERROR, _MOST_TANGENTS
            )
        self._likely = optimum.active if optimum.status is QpStatus.SOLVED else None
        return optimum

    def _continue(self, program: Program, bounds: Bounds, free: NDArray[np.bool_]) -> Optimum:
        """Follow the optimum from an arm at rest to the motion that is asked for."""
        share, step = 0.0, _FIRST_SHARE
        w, rows = np.zeros_like(program.w_free), np.zeros_like(free)
        while share < 1.0:
            trial = min(share + step, 1.0)
            part = program.scaled(trial)
            start = w * (trial / share) if share else w
            optimum = self._touch(part, bounds.cheaper(trial), free, start, rows)
            if optimum.status is QpStatus.SOLVED:
                share, w, rows = trial, optimum.w, optimum.active
            elif step > _LEAST_STEP:
                step /= 2
            else:
                return optimum
        return self._retouch(
            program, bounds, free, w, rows, _COLD_TORQUE_ERROR, _MOST_COLD_TANGENTS
        )

    def _retouch(
        self,
        program: Program,
        bounds: Bounds,
        free: NDArray[np.bool_],
        w: Array,
        rows: NDArray[np.bool_],
        torque_error: float,
        most: int,
    ) -> Optimum:
        """Take tangents anew until they fit, and keep the last optimum that there is."""
        optimum: Optimum | None = None
        for _ in range(most):
            program.forget_tangents()
            touched = self._touch(program, bounds, free, w, rows)
            if touched.status is not QpStatus.SOLVED:
                return optimum or touched
            optimum, w, rows = touched, touched.w, touched.active
            if touched.torque_error <= torque_error:
                break
        return touched

    def _touch(
        self,
        program: Program,
        bounds: Bounds,
        free: NDArray[np.bool_],
        w: Array,
        rows: NDArray[np.bool_],
    ) -> Optimum:
        """Solve the program with tangents at w; add the limits that are broken until none is."""
        rows = rows.copy()
        z, status = np.zeros(0), QpStatus.SOLVED
        values, _ = limited(program, w, bounds)
        if not np.isfinite(values).all():
            return _free_optimum(program, bounds, values, QpStatus.NOT_FINITE)
        excess = excess_of(values, bounds)
        new = rows if rows.any() else (excess > bounds.tolerance) & free
        for attempt in range(_MOST_ROUNDS):
            rows |= new
            if attempt >= _PATIENCE:
                rows |= rows.any(axis=2, keepdims=True) & free
            if not self._affords(np.count_nonzero(rows) / w.size):
                return _free_optimum(program, bounds, values, QpStatus.ITERATION_LIMIT)
            program.linearise(torque_stages(rows))
            w, z, status = self._solve_dual(program, bounds, rows, excess, w)
            values, error = limited(program, w, bounds)
            excess = excess_of(values, bounds)
            broken = excess > bounds.tolerance
            new = broken & free & ~rows
            if status is not QpStatus.SOLVED or not new.any():
                break
        else:
            status = QpStatus.ITERATION_LIMIT
        softened = bool(broken[:, 1:3].any())
        return Optimum(w, values, error, status, softened, rows, z, program, bounds)

    def _affords(self, rows: float) -> bool:
        """Whether one more dual may be solved, with so many limits a decision."""
        late = self._deadline is not None and time.perf_counter() >= self._deadline
        if late or rows > _MOST_ROWS or self._work + rows**3 > _MOST_WORK:
            return False
        self._work += rows**3
        return True

    def _solve_dual(
        self,
        program: Program,
        bounds: Bounds,
        rows: NDArray[np.bool_],
        excess: Array,
        w: Array,
    ) -> tuple[Array, Array, QpStatus]:
        """Return w, the multipliers of the chosen rows, and how the solve ended.

        Args:
            program: the program; torques in the rows have tangents.
            bounds: its limits.
            rows: the chosen rows.
            excess: excess of every limit at w.
            w: where ``excess`` was taken.
        """
        w_free = program.w_free
        C, kinds = signed_rows(program, rows)
        if not len(C):
            return w_free, np.zeros(0), QpStatus.SOLVED
        through = C @ program.hessian_inverse
        if program.refine:
            through += (C - through @ program.hessian) @ program.hessian_inverse
        gram = through @ C.T
        if not (gram.diagonal() > 0).all():  # an overflow, or a row lost to rounding
            return w_free, np.zeros(len(C)), QpStatus.NOT_FINITE
        scale = 1.0 / np.sqrt(gram.diagonal())
        k = scale.size
        excess_free = excess[rows] + C @ (w_free - w)
        dual = QuadraticProgram(
            gram * scale * scale[:, np.newaxis],
            -excess_free * scale,
            np.eye(k),
            np.zeros(k),
            np.minimum(bounds.price[kinds] / scale, UNBOUNDED),
        )
        if k not in self._workspaces:
            self._workspaces[k] = ProxqpWorkspace(k, k, self._settings)
        solution = self._workspaces[k].solve(dual)
        z = np.clip(solution.x * scale, 0.0, bounds.price[kinds])
        return w_free - z @ through, z, solution.status


def _free_optimum(program: Program, bounds: Bounds, values: Array, status: QpStatus) -> Optimum:
    """Return the minimiser without limits as an optimum in which no limit was considered."""
    rows = np.zeros((2, *values.shape), dtype=np.bool_)
    none = np.zeros(0)
    return Optimum(program.w_free, values, 0.0, status, False, rows, none, program, bounds)

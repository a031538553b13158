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

import math
import time
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.bounds import POSITION, TORQUE, VELOCITY, Bounds
from arm3dof.control.box import solve_box
from arm3dof.control.optimum import Optimum
from arm3dof.control.program import Program
from arm3dof.control.qp import SOLVED, QpSettings, QpStatus
from arm3dof.control.working_set import WorkingSet, limited
from arm3dof.state import Array

_MOST_ROUNDS = 8
_MOST_ROWS = 3.0  # limits a decision; with more, braking is the better answer
_MOST_WORK = 30.0  # duals with as many limits as decisions, in one control step
_MOST_WORK_AT_ONCE = 3.0  # in one step of the continuation; a smaller one is less work
_PATIENCE = 3  # after so many rounds a joint's limit is added for all stages at once
_TORQUE_ERROR = 0.1  # a tangent that errs by more of its limit is taken anew, ...
_MOST_TANGENTS = 3  # ... so often in a step
_COLD_TORQUE_ERROR = 1e-4  # without a last plan there is no next step that would mend an error
_MOST_COLD_TANGENTS = 8
_FIRST_SHARE = 1 / 6  # of the motion, in the first step of the continuation
_LEAST_SHARE = 1 / 40
_IDLE = 1e-9  # a multiplier below this share of the largest did not matter

_LEAST_TORQUE = 1e-9  # [N m]: a limit of zero, for the purpose of relative errors


class Likely(NamedTuple):
    """Limits that are tried first; lists, for there are few.

    Attributes:
        limits: their places in ``Bounds.sides``.
        pushing: how many of them, from the first on, are expected to push with less than their
            price.
    """

    limits: list[int]
    pushing: int

    @staticmethod
    def all_of(limits: list[int]) -> Likely:
        """Return limits that are all expected to push."""
        return Likely(limits, len(limits))


_NONE = Likely([], 0)


class ProgramSolver:
    """Solves the programs of one controller, trying first the limits that mattered last."""

    def __init__(self, settings: QpSettings) -> None:
        self._settings = settings
        self._likely = _NONE
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
        self._likely = _NONE

    def advance(self, horizon: int, nv: int) -> None:
        """Move what is remembered one stage ahead, to the next control step.

        What pushed at a stage is expected to push one stage earlier now; but it may also have
        stayed where it was.
        """
        limits = self._likely.limits
        if limits:
            moved: dict[int, None] = {}  # a set that keeps its order
            for limit in limits:
                stage = limit // nv % horizon
                if stage > 0:
                    moved[limit - nv] = None
                if stage == horizon - 1:
                    moved[limit] = None
            stayed = [limit for limit in limits if limit not in moved] if moved else []
            self._likely = Likely([*moved, *stayed], len(moved))

    def solve(self, program: Program, bounds: Bounds) -> Optimum:
        """Return the optimum of a program."""
        likely = self._likely
        if not likely.limits or program.start is None:
            values = limited(program, bounds, program.w_free)
            if bounds.keep(values):
                return _without_limits(program, bounds, values, SOLVED)
            if not _is_finite(values):
                return _without_limits(program, bounds, values, QpStatus.NOT_FINITE)
            likely = _broken_soft_limits(program, bounds, values)
        if program.start is None:
            optimum = self._continue(program, bounds)
        else:
            errors = _TORQUE_ERROR, _MOST_TANGENTS
            optimum = self._retouch(program, bounds, program.start, likely, *errors)
        solved = optimum.status is SOLVED
        self._likely = _pushing(optimum) if solved else _NONE
        return optimum

    def _continue(self, program: Program, bounds: Bounds) -> Optimum:
        """Follow the optimum from an arm at rest to the motion that is asked for."""
        share, step = 0.0, _FIRST_SHARE
        w, likely = np.zeros_like(program.w_free), _NONE
        while share < 1.0:
            trial = min(share + step, 1.0)
            start = w * (trial / share) if share else w
            optimum = self._touch(program.gentler(trial), bounds.cheaper(trial), start, likely)
            if optimum.status is SOLVED:
                share, w = trial, optimum.w
                likely = _pushing(optimum)
            elif step > _LEAST_SHARE:
                step /= 2
            else:
                return optimum
        return self._retouch(program, bounds, w, likely, _COLD_TORQUE_ERROR, _MOST_COLD_TANGENTS)

    def _retouch(
        self,
        program: Program,
        bounds: Bounds,
        w: Array,
        likely: Likely,
        torque_error: float,
        most: int,
    ) -> Optimum:
        """Take tangents anew until they fit; of several solutions keep the last that there is."""
        solved: Optimum | None = None
        for _ in range(most):
            optimum = self._touch(program, bounds, w, likely)
            if optimum.status is not SOLVED:
                return solved or optimum
            if optimum.torque_error <= torque_error:
                return optimum
            solved, w, likely = optimum, optimum.w, _pushing(optimum)
        return optimum

    def _touch(self, program: Program, bounds: Bounds, w: Array, likely: Likely) -> Optimum:
        """Solve the program with tangents at w; add the limits that are broken until none is."""
        tolerance = _tolerance(program, bounds)
        if likely.limits:
            limits, pushing = np.array(likely.limits), likely.pushing
            inside = [True] * pushing + [False] * (limits.size - pushing)
        else:
            excess = bounds.excess(limited(program, bounds, w))
            limits = (excess > tolerance).ravel().nonzero()[0]
            inside = [True] * limits.size
        working = WorkingSet.of(program, bounds, limits, w)
        is_cold = program.start is None
        most = min(self._work + _MOST_WORK_AT_ONCE, _MOST_WORK) if is_cold else _MOST_WORK
        for attempt in range(_MOST_ROUNDS):
            if not self._affords(working.b.size / w.size, most):
                values = limited(program, bounds, program.w_free)
                return _without_limits(program, bounds, values, QpStatus.ITERATION_LIMIT)
            w, z, status = self._solve_dual(program, working, inside)
            values = limited(program, bounds, w)
            error = 0.0 if working.exact else _replace_by_tangents(values, working, w)
            softened = False
            if status is not SOLVED or bounds.keep(values):
                break
            if not _is_finite(values):
                status = QpStatus.NOT_FINITE
                break
            excess = bounds.excess(values)
            softened = _exceeds_soft_limit(excess, bounds)
            impatient = attempt >= _PATIENCE - 1 and not is_cold
            new = _broken(excess, tolerance, working, all_stages=impatient)
            if not new.size:
                break
            working = working.joined(WorkingSet.of(program, bounds, new, w))
            inside = [push > 0.0 for push in z.tolist()] + [True] * new.size
        else:
            status = QpStatus.ITERATION_LIMIT
        return Optimum(w, values, status, softened, working, z, error, program, bounds)

    def _affords(self, rows: float, most: float = _MOST_WORK) -> bool:
        """Whether one more dual may be solved.

        Args:
            rows: its limits a decision.
            most: work up to which it may.
        """
        late = self._deadline is not None and time.perf_counter() >= self._deadline
        work = self._work + rows * rows * rows
        if late or rows > _MOST_ROWS or work > most:
            return False
        self._work = work
        return True

    def _solve_dual(
        self, program: Program, working: WorkingSet, inside: list[bool]
    ) -> tuple[Array, Array, QpStatus]:
        """Return w, the multipliers of the working set, and how the solve ended.

        Args:
            program: the program.
            working: its limits.
            inside: which of them are expected to push with less than their price.
        """
        C, b, through = working.C, working.b, working.through
        if not b.size:
            return program.w_free, b, SOLVED
        gradient = b - C.dot(program.w_free)  # faster than @ for so few rows
        solution = solve_box(through.dot(C.T), gradient, working.price, inside, self._settings)
        return program.w_free - solution.x.dot(through), solution.x, solution.status


def _pushing(optimum: Optimum) -> Likely:
    """Return the limits whose multipliers matter."""
    z = optimum.multipliers.tolist()
    idle = _IDLE * max(z, default=0.0)
    limits = optimum.working.limits.tolist()
    return Likely.all_of([limit for limit, push in zip(limits, z, strict=True) if push > idle])


def _broken_soft_limits(program: Program, bounds: Bounds, values: Array) -> Likely:
    """Return the limits that the minimiser without limits breaks, if they are all linear in w.

    Where torques meet their limits as well, the last plan tells better which will matter.
    """
    limits = bounds.broken(values)
    if program.fixed is not None:
        unreached = set(program.fixed.ravel().nonzero()[0].tolist())
        limits = [limit for limit in limits if limit % values.size not in unreached]
    kinds, of_a_kind = len(values), values[0].size
    if all(POSITION <= limit // of_a_kind % kinds <= VELOCITY for limit in limits):
        return Likely.all_of(limits)
    return _NONE


def _tolerance(program: Program, bounds: Bounds) -> Array:
    """Return the excess up to which a limit counts as kept; any, where no decision matters."""
    if program.fixed is None:
        return bounds.tolerance
    tolerance = bounds.tolerance.copy()
    tolerance[: VELOCITY + 1][program.fixed] = np.inf
    return tolerance


def _broken(
    excess: Array, tolerance: Array, working: WorkingSet, *, all_stages: bool
) -> NDArray[np.intp]:
    """Return the limits that are broken and not in the working set.

    Args:
        excess: by how much each limit is exceeded, shape (2, kinds, N, nv).
        tolerance: excess up to which it counts as kept, shape (kinds, N, nv).
        working: the working set.
        all_stages: if any is broken, return all stages of every limit that was or is to be added.
    """
    broken = excess > tolerance
    flat = broken.ravel()
    flat[working.limits] = False
    if all_stages and broken.any():
        flat[working.limits] = True
        broken |= broken.any(axis=2, keepdims=True) & (tolerance < np.inf)
        flat[working.limits] = False
    return flat.nonzero()[0]


def _is_finite(values: Array) -> bool:
    """Whether all values are finite, and not absurdly large; faster than ``isfinite`` and all()."""
    flat = values.ravel()
    return math.isfinite(flat.dot(flat))


def _exceeds_soft_limit(excess: Array, bounds: Bounds) -> bool:
    soft = slice(POSITION, VELOCITY + 1)
    return bool((excess[:, soft] > bounds.tolerance[soft]).any())


def _replace_by_tangents(values: Array, working: WorkingSet, w: Array) -> float:
    """Overwrite values by the tangents of a working set.

    Returns:
        The largest error of a torque's tangent, as a share of the torque's limit.
    """
    torques, count = values[TORQUE].size, values.size
    which = [limit % count for limit in working.limits.tolist()]
    flat, sides = values.ravel(), working.sides
    slopes, at_zero = working.affine()
    by_tangents = np.where(working.limits < count, 1.0, -1.0) * (slopes.dot(w) + at_zero)
    exact = flat[which]
    flat[which] = by_tangents
    rows = zip(which, exact.tolist(), by_tangents.tolist(), sides.tolist(), strict=True)
    apart = [
        abs(true - near) / max(abs(side), _LEAST_TORQUE)
        for place, true, near, side in rows
        if place < torques
    ]
    return max(apart, default=0.0)


def _without_limits(program: Program, bounds: Bounds, values: Array, status: QpStatus) -> Optimum:
    """Return the minimiser without limits as an optimum in which no limit was considered."""
    w = program.w_free
    working = _no_limits(w.size)
    return Optimum(w, values, status, False, working, working.b, 0.0, program, bounds)


@lru_cache(maxsize=16)
def _no_limits(decisions: int) -> WorkingSet:
    none, no_rows = np.zeros(0), np.zeros((0, decisions))
    return WorkingSet(np.zeros(0, dtype=np.intp), no_rows, none, no_rows, none, none, none, True)

"""The constrained program of one control step, solved so that it always has an answer.

The cost is 1/2 w' H w + g' w over the stacked decisions w. Torque limits are hard: tau is ours to
choose. Velocity and joint limits are soft, with an exact penalty: they are kept whenever the torque
can keep them, and left as little as possible when it cannot. So the program is always feasible.

It is solved in its dual, over one multiplier z >= 0 for each limit:

    w = w_free - H^-1 C' z,   z = argmin 1/2 z' (C H^-1 C') z - (C w_free - b)' z,   z <= price,

with w_free = -H^-1 g. A soft limit differs from a hard one in nothing but its price. Few limits
matter at any time: those that the solution would break are added until none is broken, and those of
the last step are tried first. What comes out is the optimum of the program with all limits; without
an active limit it is w_free, at the cost of one matrix product.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.qp import (
    UNBOUNDED,
    ProxqpWorkspace,
    QpSettings,
    QpStatus,
    QuadraticProgram,
)
from arm3dof.model.robot import Limits
from arm3dof.state import Array

_TOLERANCE = 1e-6  # a limit counts as kept up to this share of its size (1 rad, 1 rad/s at least)
_EXCESS_LEFT = 0.7  # share of an excess of speed that may be left one stage later
_MOST_ROUNDS = 8
_MOST_ROWS = 3.0  # limits a decision; with more, braking is the better answer
_PATIENCE = 3  # after so many rounds a joint's limit is added for all stages at once
_IDLE = 1e-9  # a multiplier below this share of the largest did not matter


class Program(NamedTuple):
    """Cost, prediction and torque of one control step, as functions of the decisions w.

    Stage k uses the decisions ``s_k = w[block_of_stage[k]]``, and tau_k = G_k s_k + o_k.

    Attributes:
        hessian: H, shape (n, n).
        hessian_inverse: H^-1, shape (n, n).
        w_free: minimiser of the cost without limits, shape (n,).
        block_of_stage: which block of decisions a stage uses, shape (N,).
        torque_gain: G, shape (N, nv, nv).
        torque_offset: o, shape (N, nv) [N m].
        free_response: position and velocity of stages 1..N at w = 0, shape (2, N, nv).
        response: their derivative by w, shape (2, N, nv, n).
    """

    hessian: Array
    hessian_inverse: Array
    w_free: Array
    block_of_stage: NDArray[np.intp]
    torque_gain: Array
    torque_offset: Array
    free_response: Array
    response: Array

    def torques(self, w: Array) -> Array:
        """Return the torques of all stages, shape (N, nv) [N m]."""
        nv = self.torque_offset.shape[1]
        stage = w.reshape(-1, nv)[self.block_of_stage]
        return np.asarray(
            np.matmul(self.torque_gain, stage[:, :, np.newaxis])[:, :, 0] + self.torque_offset
        )

    def states(self, w: Array) -> Array:
        """Return positions and velocities of stages 1..N, shape (2, N, nv) [rad, rad/s]."""
        flat = self.response.reshape(-1, w.size) @ w
        return self.free_response + flat.reshape(self.free_response.shape)

    def torque_rows(self, stage: NDArray[np.intp], joint: NDArray[np.intp]) -> Array:
        """Return d tau[stage, joint] / d w, shape (k, n)."""
        nv = self.torque_offset.shape[1]
        rows = np.zeros((stage.size, self.w_free.size // nv, nv))
        rows[np.arange(stage.size), self.block_of_stage[stage]] = self.torque_gain[stage, joint]
        return rows.reshape(stage.size, self.w_free.size)


class Bounds(NamedTuple):
    """Limits of each kind of row: torque, position, velocity and, if limited, torque rate.

    The second axis is that of the stages: 1 where all have the same limits, else N.

    Attributes:
        low: shape (kinds, 1 or N, nv) [N m, rad, rad/s, N m].
        high: shape (kinds, 1 or N, nv).
        tolerance: excess up to which a limit counts as kept, shape (kinds, 1 or N, nv).
        least: ``low - tolerance``.
        most: ``high + tolerance``.
        price: most that a unit of violation may cost, ``UNBOUNDED`` for a hard limit, (kinds,).
        last_torque: torque before stage 0, which the rate counts from, shape (nv,) [N m].
    """

    low: Array
    high: Array
    tolerance: Array
    least: Array
    most: Array
    price: Array
    last_torque: Array

    @staticmethod
    def around(low: Array, high: Array, price: Array, last_torque: Array) -> Bounds:
        """Return bounds with the tolerance that suits their size."""
        tolerance = _TOLERANCE * np.maximum(np.abs(high), 1.0)
        return Bounds(low, high, tolerance, low - tolerance, high + tolerance, price, last_torque)

    @staticmethod
    def of(limits: Limits, tau_max: Array, soft_price: float) -> Bounds:
        """Return the bounds of a robot.

        Args:
            limits: position and velocity limits.
            tau_max: torque limit, shape (nv,) [N m].
            soft_price: price of leaving a position or velocity limit.
        """
        high = np.stack([tau_max, limits.q_max, limits.v_max])[:, np.newaxis]
        low = np.stack([-tau_max, limits.q_min, -limits.v_max])[:, np.newaxis]
        price = np.array([UNBOUNDED, soft_price, soft_price])
        return Bounds.around(low, high, price, np.zeros_like(tau_max))

    def slowing_from(self, v: Array, horizon: int) -> Bounds:
        """Give joints that are too fast some stages to come back under their speed limit.

        A limit that has to hold one sample later is a deadbeat law: on an arm that answers twice
        as strongly as its model says, it swings up. So the excess need only shrink from stage to
        stage by a share of itself.

        Args:
            v: velocities at stage 0, shape (nv,) [rad/s].
            horizon: number of stages.
        """
        shape = (len(self.high), horizon, v.size)
        low, high = (np.array(np.broadcast_to(side, shape)) for side in (self.low, self.high))
        left = _EXCESS_LEFT ** np.arange(1.0, horizon + 1)[:, np.newaxis]
        high[2] += left * np.maximum(v - high[2], 0.0)
        low[2] += left * np.minimum(v - low[2], 0.0)
        return Bounds.around(low, high, self.price, self.last_torque)

    def with_rate(self, change: Array, last_torque: Array) -> Bounds:
        """Limit the change of torque from stage to stage as well.

        Args:
            change: largest change, shape (nv,) [N m].
            last_torque: torque in force now, shape (nv,) [N m].
        """
        most = np.broadcast_to(change, self.high[:1].shape)
        high = np.concatenate([self.high[:3], most])
        low = np.concatenate([self.low[:3], -most])
        price = np.append(self.price[:3], UNBOUNDED)
        return Bounds.around(low, high, price, last_torque)


class Optimum(NamedTuple):
    """The solution of a program.

    Attributes:
        w: decisions, shape (n,).
        tau: torques of stages 0..N-1, shape (N, nv) [N m].
        states: positions and velocities of stages 1..N, shape (2, N, nv) [rad, rad/s].
        status: how the solve ended.
        softened: whether a velocity or joint limit is exceeded.
        rows: the limits that were considered, as a mask, shape (2, kinds, N, nv): upper, lower.
        multipliers: z of these limits, in the mask's order.
        program: the program that was solved.
        bounds: its limits.
    """

    w: Array
    tau: Array
    states: Array
    status: QpStatus
    softened: bool
    rows: NDArray[np.bool_]
    multipliers: Array
    program: Program
    bounds: Bounds

    def kkt_residual(self) -> float:
        """Return the largest violation of the program's optimality conditions.

        Stationarity, feasibility of the hard limits, and complementarity: z is zero off the limit
        and, for a soft limit, its full price beyond the limit.
        """
        program, bounds = self.program, self.bounds
        C, _ = _signed_rows(program, self.rows)
        gradient = program.hessian @ (self.w - program.w_free) + C.T @ self.multipliers
        excess = _excess(_values(program, self.w, bounds), bounds)
        excess[:, 1:3] = np.where(_fixed(program), 0.0, excess[:, 1:3])
        price = np.broadcast_to(bounds.price[:, np.newaxis, np.newaxis], excess.shape)[self.rows]
        inside, outside = -excess[self.rows].clip(max=0.0), excess[self.rows].clip(min=0.0)
        unpaid = np.where(price < UNBOUNDED, 1 - self.multipliers / price, 1.0)
        parts = (gradient, self.multipliers * inside, outside * unpaid, excess[~self.rows].clip(0))
        return max(float(np.abs(part).max(initial=0.0)) for part in parts)

    def quadratic_program(self) -> QuadraticProgram:
        """Return the program as one QP in w, with every limit that a decision reaches, and hard.

        Where its limits can all be kept, its optimum is the program's.
        """
        program, bounds = self.program, self.bounds
        rows = np.ones_like(self.rows[:1])
        rows[:, 1:3] &= ~_fixed(program)
        C, _ = _signed_rows(program, rows)
        at_zero = _values(program, np.zeros_like(self.w), bounds)[rows[0]]
        low, high = (
            np.broadcast_to(side, rows[0].shape)[rows[0]] - at_zero
            for side in (bounds.low, bounds.high)
        )
        gradient = -program.hessian @ program.w_free
        return QuadraticProgram(program.hessian, gradient, C, low, high)


class ProgramSolver:
    """Solves the programs of one controller, trying first the limits that mattered last."""

    def __init__(self, settings: QpSettings) -> None:
        self._settings = settings
        self._workspaces: dict[int, ProxqpWorkspace] = {}
        self._likely: NDArray[np.bool_] | None = None

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
        values = _values(program, program.w_free, bounds)
        kept = (values <= bounds.most) & (values >= bounds.least)
        if kept.all():
            self._likely = None
            return _free_optimum(program, values, bounds, QpStatus.SOLVED)
        if not np.isfinite(values).all():
            return _free_optimum(program, values, bounds, QpStatus.NOT_FINITE)
        return self._solve_limited(program, bounds, _excess(values, bounds))

    def _solve_limited(self, program: Program, bounds: Bounds, excess_free: Array) -> Optimum:
        """Add the limits that are broken until none is."""
        broken = excess_free > bounds.tolerance
        free = np.ones_like(broken)
        free[:, 1:3] = ~_fixed(program)
        rows = np.zeros_like(broken)
        if not (broken & free).any():  # what is broken, no decision can mend
            values = _values(program, program.w_free, bounds)
            optimum = _free_optimum(program, values, bounds, QpStatus.SOLVED)
            return optimum._replace(softened=True)
        if self._likely is not None and self._likely.shape == rows.shape:
            rows |= self._likely & free
        new = broken & free
        w, z, status = program.w_free, np.zeros(0), QpStatus.SOLVED
        values = excess_free[0] + bounds.high
        for attempt in range(_MOST_ROUNDS):
            rows |= new
            if attempt >= _PATIENCE:
                rows |= rows.any(axis=2, keepdims=True) & free
            if np.count_nonzero(rows) > _MOST_ROWS * w.size:
                self._likely = None
                return _free_optimum(program, values, bounds, QpStatus.ITERATION_LIMIT)
            w, z, status = self._solve_dual(program, bounds, rows, excess_free)
            values = _values(program, w, bounds)
            broken = _excess(values, bounds) > bounds.tolerance
            new = broken & free & ~rows
            if status is not QpStatus.SOLVED or not new.any():
                break
        else:
            status = QpStatus.ITERATION_LIMIT
        self._likely = np.zeros_like(rows)
        self._likely[rows] = z > _IDLE * z.max(initial=0.0)
        softened = bool(broken[:, 1:3].any())
        return Optimum(w, values[0], values[1:3], status, softened, rows, z, program, bounds)

    def _solve_dual(
        self, program: Program, bounds: Bounds, rows: NDArray[np.bool_], excess_free: Array
    ) -> tuple[Array, Array, QpStatus]:
        """Return w, the multipliers of the chosen rows, and how the solve ended."""
        C, kinds = _signed_rows(program, rows)
        through = C @ program.hessian_inverse
        through += (C - through @ program.hessian) @ program.hessian_inverse
        gram = through @ C.T
        if not (gram.diagonal() > 0).all():  # an overflow, or a row lost to rounding
            return program.w_free, np.zeros(len(C)), QpStatus.NOT_FINITE
        scale = 1.0 / np.sqrt(gram.diagonal())
        k = scale.size
        dual = QuadraticProgram(
            gram * scale * scale[:, np.newaxis],
            -excess_free[rows] * scale,
            np.eye(k),
            np.zeros(k),
            np.minimum(bounds.price[kinds] / scale, UNBOUNDED),
        )
        if k not in self._workspaces:
            self._workspaces[k] = ProxqpWorkspace(k, k, self._settings)
        solution = self._workspaces[k].solve(dual)
        z = np.clip(solution.x * scale, 0.0, bounds.price[kinds])
        return program.w_free - z @ through, z, solution.status


def _free_optimum(program: Program, values: Array, bounds: Bounds, status: QpStatus) -> Optimum:
    """Return the minimiser without limits as an optimum in which no limit was considered."""
    rows = np.zeros((2, *values.shape), dtype=np.bool_)
    none = np.zeros(0)
    w = program.w_free
    return Optimum(w, values[0], values[1:3], status, False, rows, none, program, bounds)


def _values(program: Program, w: Array, bounds: Bounds) -> Array:
    """Return torque, position, velocity and torque change of each stage, (kinds, N, nv)."""
    torque = program.torques(w)
    values = np.empty((len(bounds.high), *torque.shape))
    values[0], values[1:3] = torque, program.states(w)
    if len(values) == 4:
        values[3] = np.diff(torque, axis=0, prepend=bounds.last_torque[np.newaxis])
    return values


def _excess(values: Array, bounds: Bounds) -> Array:
    """Return by how much each value is above its upper and below its lower limit."""
    excess = np.empty((2, *values.shape))
    np.subtract(values, bounds.high, out=excess[0])
    np.subtract(bounds.low, values, out=excess[1])
    return excess


def _fixed(program: Program) -> NDArray[np.bool_]:
    """Return which states no decision reaches, shape (2, N, nv)."""
    return np.asarray(~program.response.any(axis=-1))


def _signed_rows(program: Program, rows: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """Return the chosen rows of C, so that a limit reads C w <= b, and the kind of each."""
    side, kind, stage, joint = np.nonzero(rows)
    C = np.empty((side.size, program.w_free.size))
    is_torque, is_rate = kind == 0, kind == 3
    C[is_torque] = program.torque_rows(stage[is_torque], joint[is_torque])
    is_state = ~(is_torque | is_rate)
    C[is_state] = program.response[kind[is_state] - 1, stage[is_state], joint[is_state]]
    if is_rate.any():
        at, j = stage[is_rate], joint[is_rate]
        before = program.torque_rows(np.maximum(at - 1, 0), j)
        C[is_rate] = program.torque_rows(at, j) - before * (at > 0)[:, np.newaxis]
    C[side == 1] *= -1.0
    return C, kind

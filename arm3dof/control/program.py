"""The constrained program of one control step: what is minimised, and what is limited.

The cost is 1/2 w' H w + g' w over the stacked decisions w. Torque limits are hard: tau is ours to
choose. Velocity and joint limits are soft, with an exact penalty: they are kept whenever the torque
can keep them, and left as little as possible when it cannot. So the program is always feasible.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.qp import UNBOUNDED
from arm3dof.model.robot import Limits
from arm3dof.state import Array

_TOLERANCE = 1e-6  # a limit counts as kept up to this share of its size (1 rad, 1 rad/s at least)
_EXCESS_LEFT = 0.7  # share of an excess of speed that may be left one stage later


class Program(Protocol):
    """Cost, and limited values, of one control step, as functions of the decisions w.

    Positions and velocities are linear in w. Torques may not be; ``linearise`` replaces those of
    some stages by their tangents.

    Attributes:
        hessian: H, shape (n, n).
        hessian_inverse: H^-1, shape (n, n).
        refine: whether H is so ill-conditioned that products with its inverse need refinement.
        exact: whether the torques are linear in w, so that tangents change nothing.
        w_free: minimiser of the cost without limits, shape (n,).
        start: decisions near which the optimum is expected, shape (n,); ``None`` if unknown.
        reached: which positions and velocities depend on w at all, shape (2, N, nv).
    """

    hessian: Array
    hessian_inverse: Array
    refine: bool
    exact: bool
    w_free: Array
    start: Array | None
    reached: NDArray[np.bool]

    def values(self, w: Array) -> tuple[Array, Array]:
        """Return what is limited, and the torques themselves.

        Args:
            w: decisions, shape (n,).

        Returns:
            Torques of stages 0..N-1 (by their tangents, where there are some), positions and
            velocities of stages 1..N, shape (3, N, nv); and the torques without tangents, (N, nv).
        """

    def linearise(self, stages: NDArray[np.bool_]) -> None:
        """Give stages that have none a tangent, where ``values`` was asked last.

        Args:
            stages: which, as a mask, shape (N,).
        """

    def forget_tangents(self) -> None:
        """Evaluate all torques themselves again."""

    def scaled(self, share: float) -> Program:
        """Return the program of a gentler motion from the same place: a share of it in all.

        Speed and way to the target are that share of this program's; at 0 the arm rests.
        """

    def rows(
        self, kind: NDArray[np.intp], stage: NDArray[np.intp], joint: NDArray[np.intp]
    ) -> Array:
        """Return the derivatives by w of some values, shape (k, n).

        Args:
            kind: 0 for torque, 1 for position, 2 for velocity, shape (k,).
            stage: 0..N-1, as in ``values``, shape (k,); of torques, those with a tangent.
            joint: shape (k,).
        """


class LinearProgram:
    """A program whose torques are linear in the decisions, too.

    Stage k uses the decisions ``s_k = w[block_of_stage[k]]``, and tau_k = G_k s_k + o_k.
    """

    exact, refine = True, True

    def __init__(
        self,
        *,
        hessian: Array,
        hessian_inverse: Array,
        w_free: Array,
        block_of_stage: NDArray[np.intp],
        torque_gain: Array,
        torque_offset: Array,
        free_response: Array,
        response: Array,
    ) -> None:
        """Create a program.

        Args:
            hessian: H, shape (n, n).
            hessian_inverse: H^-1, shape (n, n).
            w_free: minimiser of the cost without limits, shape (n,).
            block_of_stage: which block of decisions a stage uses, shape (N,).
            torque_gain: G, shape (N, nv, nv).
            torque_offset: o, shape (N, nv) [N m].
            free_response: position and velocity of stages 1..N at w = 0, shape (2, N, nv).
            response: their derivative by w, shape (2, N, nv, n).
        """
        self.hessian, self.hessian_inverse = hessian, hessian_inverse
        self.w_free = w_free
        self.start: Array | None = w_free
        self._blocks, self._gain, self._offset = block_of_stage, torque_gain, torque_offset
        self._free, self._response = free_response, response
        self.reached: NDArray[np.bool_] = np.asarray(response.any(axis=-1))

    def values(self, w: Array) -> tuple[Array, Array]:
        """See ``Program.values``."""
        values = np.empty((3, *self._offset.shape))
        stage = w.reshape(-1, values.shape[2])[self._blocks]
        values[0] = np.matmul(self._gain, stage[:, :, np.newaxis])[:, :, 0] + self._offset
        values[1:] = (self._response.reshape(-1, w.size) @ w).reshape(self._free.shape) + self._free
        return values, values[0]

    def linearise(self, stages: NDArray[np.bool_]) -> None:
        """Do nothing: every value is its own tangent."""

    def forget_tangents(self) -> None:
        """Do nothing: every value is its own tangent."""

    def scaled(self, share: float) -> Program:
        """Return itself: what is linear needs no gentler start."""
        return self

    def rows(
        self, kind: NDArray[np.intp], stage: NDArray[np.intp], joint: NDArray[np.intp]
    ) -> Array:
        """See ``Program.rows``."""
        nv = self._offset.shape[1]
        rows = self._response[kind - 1, stage, joint]
        of_torque = (kind == 0).nonzero()[0]
        k = stage[of_torque]
        rows[of_torque] = 0.0
        by_block = rows.reshape(kind.size, -1, nv)
        by_block[of_torque, self._blocks[k]] = self._gain[k, joint[of_torque]]
        return rows


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

    def cheaper(self, share: float) -> Bounds:
        """Return the bounds with a share of the price of leaving soft limits."""
        soft = self.price < UNBOUNDED
        return self._replace(price=np.where(soft, share * self.price, self.price))

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

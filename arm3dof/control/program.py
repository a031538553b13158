"""What a control step minimises, and what it limits, as functions of its decisions.

The cost is 1/2 w' H w + g' w over the stacked decisions w. Torque limits are hard: tau is ours to
choose. Velocity and joint limits are soft, with an exact penalty: they are kept whenever the torque
can keep them, and left as little as possible when it cannot. So the program is always feasible.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from arm3dof.state import Array


def sizes(slopes: Array, through: Array) -> Array:
    """Return the sizes of tangents, shape (k,); 1 for a value that is fixed.

    Where rounding has left nothing of a size it is NaN, so that nobody takes it for one.

    Args:
        slopes: shape (k, n).
        through: ``slopes @ H^-1``, shape (k, n).
    """
    squared = np.einsum("ij,ij->i", through, slopes)
    squared[~slopes.any(axis=1)] = 1.0
    squared[squared <= 0.0] = np.nan
    return np.asarray(np.sqrt(squared))


class Tangents(NamedTuple):
    """Tangents of limited values, each in units of its size: ``slopes @ w + offsets``.

    They grow towards the limit: those of values with a lower limit have their signs turned. The
    size, sqrt(c' H^-1 c) of a slope c, is what makes the diagonal of the program's dual one.

    Attributes:
        slopes: shape (k, n).
        offsets: shape (k,).
        through: ``slopes @ H^-1``, shape (k, n).
        size: shape (k,).
        exact: whether the values are linear, so that their tangents touch them everywhere.
    """

    slopes: Array
    offsets: Array
    through: Array
    size: Array
    exact: bool

    @staticmethod
    def scaled(slopes: Array, offsets: Array, program: Program, *, exact: bool) -> Tangents:
        """Return tangents whose slopes and offsets are not yet divided by their size."""
        through = slopes.dot(program.hessian_inverse)
        if program.refine:
            through += (slopes - through @ program.hessian) @ program.hessian_inverse
        size = sizes(slopes, through)
        column = size[:, np.newaxis]
        return Tangents(slopes / column, offsets / size, through / column, size, exact)


class Program(Protocol):
    """Cost and limited values of one control step.

    The values are the torques of stages 0..N-1, and the positions and velocities of stages 1..N, in
    this order, shape (3, N, nv). Positions and velocities are linear in w; torques may not be.

    Attributes:
        hessian: H, shape (n, n).
        hessian_inverse: H^-1, shape (n, n).
        refine: whether H is so ill-conditioned that products with its inverse need refinement.
        w_free: minimiser of the cost without limits, shape (n,).
        fixed: which values do not depend on w at all, shape (3, N, nv); ``None`` if all do.
    """

    hessian: Array
    hessian_inverse: Array
    refine: bool
    w_free: Array
    fixed: NDArray[np.bool_] | None

    @property
    def start(self) -> Array | None:
        """Decisions near which the optimum is expected, shape (n,); ``None`` if unknown."""

    def values(self, w: Array) -> Array:
        """Return torques, positions and velocities, shape (3, N, nv)."""

    def tangents(self, limits: NDArray[np.intp], w: Array) -> Tangents:
        """Return the tangents of some limited values.

        Args:
            limits: their places among the upper limits of the flattened values, followed by the
                lower ones, shape (k,).
            w: where the tangents touch, shape (n,).
        """

    def accelerations(self, w: Array) -> Array | None:
        """Return the accelerations of stages 0..N-1, the last twice, if they are what is decided.

        Their shape is (N + 1, nv). ``None`` says that they have to be read from the velocities.
        """

    def gentler(self, share: float) -> Program:
        """Return the program of a gentler motion from the same place: a share of it in all.

        Speed and way to the target are that share of this program's; at 0 the arm rests.
        """


class LinearProgram:
    """A program whose torques are linear in the decisions, too.

    Stage k uses the decisions ``s_k = w[block_of_stage[k]]``, and tau_k = G_k s_k + o_k.
    """

    refine = True

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
        horizon, nv = torque_offset.shape
        self.hessian, self.hessian_inverse = hessian, hessian_inverse
        self.w_free = w_free
        self.start: Array | None = w_free
        rows = np.zeros((3, horizon, nv, w_free.size // nv, nv))
        rows[0, np.arange(horizon), :, block_of_stage] = torque_gain
        rows = rows.reshape(3, horizon, nv, -1)
        rows[1:] = response
        fixed = np.asarray(~rows.any(axis=-1))
        self.fixed: NDArray[np.bool_] | None = fixed if fixed.any() else None
        self._slopes = rows.reshape(-1, w_free.size)
        self._offsets = np.concatenate([torque_offset[np.newaxis], free_response])

    def values(self, w: Array) -> Array:
        """See ``Program.values``."""
        return np.asarray((self._slopes @ w).reshape(self._offsets.shape) + self._offsets)

    def tangents(self, limits: NDArray[np.intp], w: Array) -> Tangents:
        """See ``Program.tangents``: every value is its own tangent."""
        lower, which = np.divmod(limits, self._offsets.size)
        sign = 1.0 - 2.0 * lower
        slopes = sign[:, np.newaxis] * self._slopes[which]
        return Tangents.scaled(slopes, sign * self._offsets.ravel()[which], self, exact=True)

    def accelerations(self, w: Array) -> Array | None:
        """See ``Program.accelerations``."""
        return None

    def gentler(self, share: float) -> Program:
        """Return itself: what is linear needs no gentle start."""
        return self

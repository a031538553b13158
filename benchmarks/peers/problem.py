"""The optimal control problem that ours and every peer solve, as plain arrays.

minimise  sum_k x_k' Q x_k + u_k' R u_k + x_N' P x_N,   x = [e; v],  e = q_target - q
subject to  x_(k+1) = A x_k + B u_k,  u the joint acceleration,
            |M(q_k) u_k + C(q_k, v_k) v_k + g(q_k) + D (v_k + T u_k)| <= tau_max,
            |v_k| <= v_max,  q_min <= q_k <= q_max  (left only at ``limit_price`` a unit).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arm:
    """A tree of revolute joints, each with one rigid body; n joints.

    Attributes:
        parents: joint that each joint hangs on; -1 is the base, shape (n,).
        rotations: from each joint's frame to its parent's, at zero angle, shape (n, 3, 3).
        translations: origin of each joint in its parent's frame, shape (n, 3) [m].
        axes: unit axis of each joint in its own frame, shape (n, 3).
        masses: shape (n,) [kg].
        centres: centres of mass in the joints' frames, shape (n, 3) [m].
        inertias: inertias about the centres of mass, along the joints' axes,
            shape (n, 3, 3) [kg m^2].
        gravity: acceleration of gravity in the base frame, shape (3,) [m/s^2].
    """

    parents: Array
    rotations: Array
    translations: Array
    axes: Array
    masses: Array
    centres: Array
    inertias: Array
    gravity: Array

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.parents.size)


@dataclass(frozen=True, eq=False)
class Problem:
    """One arm's optimal control problem, for any start and target.

    Attributes:
        arm: the arm.
        horizon: number of stages N.
        dt: sampling time T [s].
        A: shape (2 n, 2 n).
        B: shape (2 n, n).
        Q: weight of x at stages 0..N-1, shape (2 n, 2 n).
        R: weight of u, shape (n, n).
        P: weight of x at stage N, shape (2 n, 2 n).
        damping: D, viscous friction of each joint, shape (n,) [N m s/rad].
        damping_share: where in a sample damping acts, from 0, its start, to 1, its end, shape (n,).
        tau_max: torque limits, shape (n,) [N m].
        v_max: speed limits, shape (n,) [rad/s].
        q_min: lowest positions, shape (n,) [rad].
        q_max: highest positions, shape (n,) [rad].
        limit_price: what a radian or rad/s outside a limit costs, at every stage.
    """

    arm: Arm
    horizon: int
    dt: float
    A: Array
    B: Array
    Q: Array
    R: Array
    P: Array
    damping: Array
    damping_share: Array
    tau_max: Array
    v_max: Array
    q_min: Array
    q_max: Array
    limit_price: float

    def to_dict(self) -> dict[str, Any]:
        """Return the problem as values that JSON can hold."""
        return _lists(asdict(self))

    @staticmethod
    def from_dict(values: dict[str, Any]) -> Problem:
        """Return the problem that ``to_dict`` wrote."""
        arm = Arm(**{field.name: np.array(values["arm"][field.name]) for field in fields(Arm)})
        rest = {name: np.array(value) for name, value in values.items() if isinstance(value, list)}
        return Problem(**{**values, **rest, "arm": arm})


def _lists(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: _lists(value)
        if isinstance(value, dict)
        else value.tolist()
        if isinstance(value, np.ndarray)
        else value
        for name, value in values.items()
    }

"""The limits of a control step: what they are, and what it costs to leave them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from arm3dof.control.qp import UNBOUNDED
from arm3dof.model.robot import Limits
from arm3dof.state import Array

TORQUE, POSITION, VELOCITY, RATE = range(4)  # the kinds of what is limited, in order
_EXCESS_LEFT = 0.7  # share of an excess of speed that may be left one stage later
_TOLERANCE = 1e-6  # a limit counts as kept up to this share of its size (1 rad, 1 rad/s at least)


class Bounds(NamedTuple):
    """Limits of each kind, stage and joint; the last kind only if the torque rate is limited.

    A limit is known by its place among the flattened upper limits, followed by the lower ones.

    Attributes:
        sides: all upper limits, then all lower ones with their signs turned, (2 kinds N nv,)
            [N m, rad, rad/s, N m].
        tolerance: excess up to which a limit counts as kept, shape (kinds, N, nv).
        least: ``low - tolerance``.
        most: ``high + tolerance``.
        prices: most that a unit of violation may cost, ``UNBOUNDED`` for a hard limit, in the order
            of ``sides``.
        last_torque: torque before stage 0, which the rate counts from, shape (nv,) [N m].
    """

    sides: Array
    tolerance: Array
    least: Array
    most: Array
    prices: Array
    last_torque: Array

    @staticmethod
    def between(low: Array, high: Array, price: Array, last_torque: Array) -> Bounds:
        """Return bounds with the tolerance that suits their size, and a price for each kind."""
        tolerance = _TOLERANCE * np.maximum(np.abs(high), 1.0)
        sides = np.concatenate([high.ravel(), -low.ravel()])
        prices = np.tile(np.repeat(price, high[0].size), 2)
        return Bounds(sides, tolerance, low - tolerance, high + tolerance, prices, last_torque)

    @property
    def high(self) -> Array:
        """Upper limits, shape (kinds, N, nv)."""
        return self.sides[: self.tolerance.size].reshape(self.tolerance.shape)

    @property
    def low(self) -> Array:
        """Lower limits, shape (kinds, N, nv)."""
        return -self.sides[self.tolerance.size :].reshape(self.tolerance.shape)

    @staticmethod
    def of(limits: Limits, tau_max: Array, soft_price: float, horizon: int) -> Bounds:
        """Return the bounds of a robot.

        Args:
            limits: position and velocity limits.
            tau_max: torque limit, shape (nv,) [N m].
            soft_price: price of leaving a position or velocity limit.
            horizon: number of stages N.
        """
        high = np.repeat([[tau_max], [limits.q_max], [limits.v_max]], horizon, axis=1)
        low = np.repeat([[-tau_max], [limits.q_min], [-limits.v_max]], horizon, axis=1)
        price = np.array([UNBOUNDED, soft_price, soft_price])
        return Bounds.between(low, high, price, np.zeros_like(tau_max))

    def with_rate(self, change: Array, last_torque: Array) -> Bounds:
        """Limit the change of torque from stage to stage as well.

        Args:
            change: largest change, shape (nv,) [N m].
            last_torque: torque in force now, shape (nv,) [N m].
        """
        most = np.broadcast_to(change, (1, *self.tolerance.shape[1:]))
        high = np.concatenate([self.high[:RATE], most])
        low = np.concatenate([self.low[:RATE], -most])
        of_each_kind = self.prices[:: most.size][:RATE]
        price = np.append(of_each_kind, UNBOUNDED)
        return Bounds.between(low, high, price, last_torque)

    def slowing_from(self, v: Array) -> Bounds:
        """Give joints that are too fast some stages to come back under their speed limit.

        A limit that has to hold one sample later is a deadbeat law: on an arm that answers twice
        as strongly as its model says, it swings up. So the excess need only shrink from stage to
        stage by a share of itself.

        Args:
            v: velocities at stage 0, shape (nv,) [rad/s].
        """
        _, horizon, nv = self.tolerance.shape
        sides, tolerance, least, most, prices, last_torque = self
        sides, least, most = sides.copy(), least.copy(), most.copy()
        of_speed = slice(VELOCITY * horizon * nv, (VELOCITY + 1) * horizon * nv)
        forth, back = sides[of_speed], sides[tolerance.size :][of_speed]
        most_forth, most_back = forth[:nv].tolist(), back[:nv].tolist()
        for joint, speed in enumerate(v.tolist()):
            # views with names: what is added to them is added in place, and not copied once more
            if speed > most_forth[joint]:
                more = (speed - most_forth[joint]) * _excess_left(horizon)
                side, edge = forth[joint::nv], most[VELOCITY, :, joint]
                side += more
                edge += more
            elif -speed > most_back[joint]:
                more = (-speed - most_back[joint]) * _excess_left(horizon)
                side, edge = back[joint::nv], least[VELOCITY, :, joint]
                side += more
                edge -= more
        return Bounds(sides, tolerance, least, most, prices, last_torque)

    def cheaper(self, share: float) -> Bounds:
        """Return the bounds with a share of the price of leaving soft limits."""
        soft = self.prices < UNBOUNDED
        return self._replace(prices=np.where(soft, share * self.prices, self.prices))

    def keep(self, values: Array) -> bool:
        """Whether all values are inside the bounds, up to the tolerance; NaN is not.

        Args:
            values: shape (kinds, N, nv).
        """
        kept = (values <= self.most) & (values >= self.least)
        return b"\0" not in kept.tobytes()  # many times faster than all()

    def broken(self, values: Array) -> list[int]:
        """Return the limits that values exceed by more than the tolerance.

        Args:
            values: shape (kinds, N, nv).
        """
        above, below = (values > self.most).ravel(), (values < self.least).ravel()
        return [*above.nonzero()[0].tolist(), *(below.nonzero()[0] + values.size).tolist()]

    def excess(self, values: Array) -> Array:
        """Return by how much values are above the upper and below the lower limits.

        Args:
            values: shape (kinds, N, nv).

        Returns:
            Shape (2, kinds, N, nv); flattened, it is in the order of ``sides``.
        """
        excess = np.empty((2, *values.shape))
        np.subtract(values, self.high, out=excess[0])
        np.subtract(self.low, values, out=excess[1])
        return excess


@lru_cache(maxsize=16)
def _excess_left(horizon: int) -> Array:
    """Return the share of an excess of speed that is left at stages 1..N, shape (N,)."""
    return np.asarray(_EXCESS_LEFT ** np.arange(1.0, horizon + 1))

"""Following a way: where the joints are to be, and whether they get there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm3dof.control.reference import JointTrajectory, Target
from arm3dof.runtime.tasks.machine import Event
from arm3dof.runtime.tasks.route import Leg, Planner
from arm3dof.state import Array, JointState

_ARRIVED = np.deg2rad(1.5)
_STILL = 0.15  # [rad/s]
_LATE = 0.8  # how long after its time the arm may arrive [s]
_NEAR = np.deg2rad(4.0)  # and how far off it may be then, by friction or a wrong mass
_FAR_OFF = np.deg2rad(14.0)  # from the trajectory: something stops the arm


class Follower:
    """Holds the way that an arm is on.

    Attributes:
        target: where the joints are to be: one configuration, or a trajectory.
    """

    def __init__(self, planner: Planner, q: Array) -> None:
        """Begin at rest at a configuration, shape (nv,) [rad]."""
        self._planner = planner
        self.target: Target = q
        self._since = 0.0

    @property
    def end(self) -> Array:
        """The configuration in which the way ends, shape (nv,) [rad]."""
        target = self.target
        return np.asarray(target.q[-1] if isinstance(target, JointTrajectory) else target, float)

    def hold(self) -> None:
        """Go to the end of the way at once."""
        self.target = self.end

    def follow(self, legs: Sequence[Leg], state: JointState) -> None:
        """Begin a way where the last one was to end, or where the arm is when it is not there."""
        start = self.end
        if float(np.abs(start - state.q).max()) > 2 * _ARRIVED:
            start = np.array(state.q)
        self.target = self._planner.follow(legs, start, state.t) if legs else start
        self._since = state.t

    def progress(self, state: JointState) -> Event | None:
        """Say whether the arm has arrived at the end of its way, or will not; None for not yet."""
        target, t = self.target, state.t
        if isinstance(target, JointTrajectory) and t < target.times[-1]:
            off = np.abs(target.sample(np.array([t])).q[0] - state.q).max()
            return Event.STOPPED if off > _FAR_OFF else None
        end = float(target.times[-1]) if isinstance(target, JointTrajectory) else self._since
        off = float(np.abs(self.end - state.q).max())
        if off < _ARRIVED and float(np.abs(state.v).max()) < _STILL:
            return Event.ARRIVED
        if t > end + _LATE:
            return Event.ARRIVED if off < _NEAR else Event.STOPPED
        return None

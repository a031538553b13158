"""Objects over many pictures: a constant-velocity Kalman filter each, with an honest sigma.

What is wrong with a camera is wrong in every picture, and no number of pictures makes it better.
So the filters weigh the noise of the pictures alone, and what all pictures share - light at the
edges, width, lens, pose, table - is added to what they state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from arm3dof.errors import InputError
from arm3dof.state import Array, frozen_array
from arm3dof.vision.budget import Cause
from arm3dof.vision.locate import Located, View

_GATE = 25.0  # of chi-squared with 3 degrees of freedom: one in 65,000 is further off
_FAR = 1e6
_LEAST_NOISE = 1e-4  # of a place in one picture [m]


@dataclass(frozen=True)
class TrackerSettings:
    """How objects are taken to move.

    Attributes:
        acceleration_sigma: of changes of velocity, as white noise [m/s^2 in a second].
        speed_sigma: of a new object's velocity along an axis [m/s].
        patience_s: an object that was not seen for longer is lost [s].
        confirm: an object counts once it was seen so often.

    Raises:
        InputError: a number is out of range.
    """

    acceleration_sigma: float = 0.3
    speed_sigma: float = 0.3
    patience_s: float = 1.0
    confirm: int = 2

    def __post_init__(self) -> None:
        for name in ("acceleration_sigma", "speed_sigma", "patience_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} is {value}; give a number above 0")
        if self.confirm < 1:
            raise InputError(f"confirm is {self.confirm}; give 1 or more")


@dataclass(frozen=True, eq=False)
class Track:
    """One object, as known at a time.

    Attributes:
        number: which object, counted from 0; no two of a tracker share one.
        target: name of its target.
        t: the time [s].
        p_base: its centre in the base frame, shape (3,) [m].
        v_base: its velocity, shape (3,) [m/s].
        covariance_base: of ``p_base``, what all pictures share included, shape (3, 3) [m^2].
        seen_at: when it was last seen [s].
        hits: how often it was seen.
    """

    number: int
    target: str
    t: float
    p_base: Array
    v_base: Array
    covariance_base: Array
    seen_at: float
    hits: int

    @property
    def age_s(self) -> float:
        """Time since it was last seen [s]."""
        return self.t - self.seen_at

    @property
    def sigma_m(self) -> float:
        """Standard deviation of its place in the least certain direction [m]."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.covariance_base)[-1]), 0.0))


class Tracker:
    """Follows objects by colour and place, from picture to picture."""

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        """Begin with nothing seen."""
        self.settings = settings or TrackerSettings()
        self._followed: list[_Followed] = []
        self._count = 0
        self._t = -math.inf

    def update(self, view: View | Sequence[Located], t: float) -> tuple[Track, ...]:
        """Take in what was seen at a time.

        Args:
            view: what was seen.
            t: when its picture was taken, later than the one before [s].

        Returns:
            The objects that are known then, the oldest first.

        Raises:
            InputError: the time is not finite, or not later than the last.
        """
        if not (math.isfinite(t) and t > self._t):
            raise InputError(f"t is {t} after {self._t}; give the pictures in the order of time")
        self._t = t
        located = view.located if isinstance(view, View) else tuple(view)
        for followed in self._followed:
            followed.move_to(t, self.settings.acceleration_sigma)
        left = list(located)
        for followed, seen in self._pairs(located):
            followed.correct(seen, t)
            left.remove(seen)
        for seen in left:
            new = _Followed.begin(self._count, seen, t, self.settings.speed_sigma)
            self._followed.append(new)
            self._count += 1
        patience = self.settings.patience_s
        self._followed = [it for it in self._followed if t - it.seen_at <= patience]
        return self.at(t)

    def at(self, t: float) -> tuple[Track, ...]:
        """Return where the objects are expected at a time, the oldest first.

        Args:
            t: a time at or after the last update [s].

        Raises:
            InputError: the time is before the last update.
        """
        if t < self._t:
            raise InputError(f"t is {t}; give a time from the last picture's on, {self._t}")
        known = [it for it in self._followed if it.hits >= self.settings.confirm]
        return tuple(it.track(t, self.settings.acceleration_sigma) for it in known)

    def _pairs(self, located: Sequence[Located]) -> list[tuple[_Followed, Located]]:
        """Give each object what it was seen as: the likeliest pairs of one colour in the gate."""
        if not (self._followed and located):
            return []
        costs = np.array([[it.distance(seen) for seen in located] for it in self._followed])
        costs[costs > _GATE] = _FAR
        rows, columns = linear_sum_assignment(costs)
        return [
            (self._followed[row], located[column])
            for row, column in zip(rows, columns, strict=True)
            if costs[row, column] < _FAR
        ]


@dataclass
class _Followed:
    """The filter of one object: a state of place and velocity, shape (6,)."""

    number: int
    target: str
    t: float
    state: Array
    covariance: Array
    shared: Array
    seen_at: float
    hits: int = field(default=1)

    @classmethod
    def begin(cls, number: int, seen: Located, t: float, speed: float) -> _Followed:
        noise, shared = _parts(seen)
        covariance = np.zeros((6, 6))
        covariance[:3, :3], covariance[3:, 3:] = noise, speed**2 * np.eye(3)
        return cls(
            number, seen.target, t, np.append(seen.p_base, np.zeros(3)), covariance, shared, t
        )

    def move_to(self, t: float, acceleration: float) -> None:
        self.state, self.covariance = _moved(self.state, self.covariance, t - self.t, acceleration)
        self.t = t

    def distance(self, seen: Located) -> float:
        """Return by how much what was seen is off, as a squared number of deviations."""
        if seen.target != self.target:
            return _FAR
        miss = seen.p_base - self.state[:3]
        noise, _ = _parts(seen)
        return float(miss @ np.linalg.solve(self.covariance[:3, :3] + noise, miss))

    def correct(self, seen: Located, t: float) -> None:
        noise, self.shared = _parts(seen)
        gain = np.linalg.solve(self.covariance[:3, :3] + noise, self.covariance[:3]).T
        self.state = self.state + gain @ (seen.p_base - self.state[:3])
        left = np.eye(6) - gain @ np.eye(3, 6)
        self.covariance = left @ self.covariance @ left.T + gain @ noise @ gain.T
        self.seen_at, self.hits = t, self.hits + 1

    def track(self, t: float, acceleration: float) -> Track:
        state, covariance = _moved(self.state, self.covariance, t - self.t, acceleration)
        return Track(
            self.number,
            self.target,
            t,
            frozen_array(state[:3], 3, name="p_base"),
            frozen_array(state[3:], 3, name="v_base"),
            frozen_array(covariance[:3, :3] + self.shared, 3, 3, name="covariance_base"),
            self.seen_at,
            self.hits,
        )


def _moved(state: Array, covariance: Array, dt: float, acceleration: float) -> tuple[Array, Array]:
    """Move a state on at constant velocity, with white noise for its acceleration."""
    eye = np.eye(3)
    step = np.block([[eye, dt * eye], [0 * eye, eye]])
    noise = acceleration**2 * np.block(
        [[dt**3 / 3 * eye, dt**2 / 2 * eye], [dt**2 / 2 * eye, dt * eye]]
    )
    return step @ state, step @ covariance @ step.T + noise


def _parts(seen: Located) -> tuple[Array, Array]:
    """Return what is new in each picture, and what all pictures share; both of shape (3, 3)."""
    if not seen.budget:
        return seen.covariance_base, np.zeros((3, 3))
    noise = seen.budget.get(Cause.NOISE, np.zeros((3, 3)))
    shared: Array = seen.covariance_base - noise
    return noise + _LEAST_NOISE**2 * np.eye(3), shared

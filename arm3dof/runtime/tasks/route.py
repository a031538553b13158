"""Ways for the hand: rise, turn, descend, with every point of the way checked for clearance.

A way is a polyline of tool positions in (azimuth, radius, height), which is how an arm with a
turning base moves. On each leg the arm starts and ends at rest (minimum jerk: Flash and Hogan
1985), as fast as its joints and its hand may go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.reference import JointTrajectory
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.clearance import Clearance, Obstacle
from arm3dof.runtime.tasks.machine import Failure, Refusal
from arm3dof.state import Array

MARGIN = 0.003
"""Least gap between the arm and anything else [m]."""

LIFTED = 0.035
"""Height of the tool above the base's origin at which the hand travels [m]."""

_CELL = 0.008  # [m] between two points of a way
_TURN = 0.04  # of a joint between two points of a way [rad]
_KNOT = 0.04  # [s] between two knots of a trajectory
_SHORTEST = 0.25  # time of a leg [s]
_PEAK = 1.875  # of a minimum-jerk speed over its mean
_HEIGHTS = (LIFTED, LIFTED + 0.02, LIFTED + 0.04)  # heights to travel at, lowest first [m]
_BRANCH = "elbow-up"


@dataclass(frozen=True)
class Pace:
    """How fast the arm goes.

    Attributes:
        joint_speed: highest speed of a joint [rad/s].
        hand_speed: highest speed of the hand [m/s].
    """

    joint_speed: float
    hand_speed: float


BRISK, CAREFUL = Pace(2.2, 0.45), Pace(1.2, 0.12)
"""Through free air; near things."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A straight line in (azimuth, radius, height) as configurations.

    Attributes:
        q: configurations along it, shape (k, nv) [rad].
        pace: how fast.
    """

    q: Array
    pace: Pace


class Planner:
    """Plans ways for one arm."""

    def __init__(self, robot: Robot, clearance: Clearance) -> None:
        """Take up an arm and what measures its gaps."""
        self.robot, self.clearance = robot.clone(), clearance

    def tool(self, q: ArrayLike) -> Array:
        """Return where the tool is, shape (3,) [m]."""
        return np.array(self.robot.placement(q).translation)

    def forearm(self, q: ArrayLike) -> Array:
        """Return the direction in which the forearm points, a unit vector, shape (3,)."""
        return np.array(self.robot.placement(q).rotation[:, 0])

    def pitch(self, q: ArrayLike) -> float:
        """Return how far the forearm points above the horizon [rad]."""
        return float(np.arcsin(np.clip(self.forearm(q)[2], -1, 1)))

    def solve(self, point: ArrayLike) -> Array | str:
        """Return the configuration that holds the tool at a point from above, or why there is none.

        The elbow is above the line from shoulder to tool, and the base faces the point, where the
        arm has such branches: then the forearm slants down.
        """
        reach = inverse_kinematics(self.robot, point)
        rows = zip(reach.solutions, reach.branches, reach.within_limits, strict=True)
        inside = [(branch, q) for q, branch, within in rows if within]
        for branch, q in inside:
            if branch.startswith("front") and branch.endswith((_BRANCH, "straight")):
                return np.asarray(q)
        for branch, q in inside:
            if branch.startswith("numeric"):
                return np.asarray(q)
        return reach.sentence if not inside else "the forearm would not slant down to it"

    def line(self, start: ArrayLike, end: ArrayLike, pace: Pace) -> Leg | str:
        """Return the leg between two points of the base frame, or why there is none.

        Args:
            start: where the tool is, shape (3,) [m].
            end: where it goes, shape (3,) [m].
            pace: how fast.
        """
        first, last = _cylindrical(start), _cylindrical(end)
        length = max(
            float(np.linalg.norm(np.subtract(end, start))),
            abs(last[0] - first[0]) * max(first[1], last[1]),
        )
        count = max(int(np.ceil(length / _CELL)) + 1, 2)
        path: list[Array] = []
        for share in np.linspace(0, 1, count):
            azimuth, radius, height = first + share * (last - first)
            q = self.solve((radius * np.cos(azimuth), radius * np.sin(azimuth), height))
            if isinstance(q, str):
                return q
            path.append(q)
        return Leg(np.array(path), pace)

    def travel(
        self,
        start: ArrayLike,
        end: ArrayLike,
        opening: float,
        obstacles: Sequence[Obstacle],
        held: Array | None = None,
    ) -> list[Leg] | Refusal:
        """Return legs that rise, turn and descend from one point to another, clear of everything.

        Args:
            start: where the tool is, shape (3,) [m].
            end: where it goes, shape (3,) [m].
            opening: of the gripper [m].
            obstacles: what stands around.
            held: points of what is held, in the tool frame, shape (n, 3) [m].
        """
        start, end = np.asarray(start, float), np.asarray(end, float)
        worst = Refusal(Failure.BLOCKED, "there is no height to travel at")
        for height in _HEIGHTS:
            points = [start, _raised(start, height), _raised(end, height), end]
            legs = self._legs(points)
            if isinstance(legs, str):
                worst = Refusal(Failure.OUT_OF_REACH, legs)
                continue
            path = np.concatenate([leg.q for leg in legs])
            blocked = self._blocked(path, opening, obstacles, held)
            if blocked is None:
                return legs
            worst = blocked
        return worst

    def direct(
        self, q: ArrayLike, end: ArrayLike, opening: float, obstacles: Sequence[Obstacle]
    ) -> list[Leg] | Refusal:
        """Return the leg on which every joint turns evenly to where it is to be, if it is clear.

        Args:
            q: where the arm is, shape (nv,) [rad].
            end: where it goes, shape (nv,) [rad].
            opening: of the gripper [m].
            obstacles: what stands around.
        """
        q, end = np.asarray(q, float), np.asarray(end, float)
        count = int(np.ceil(np.abs(end - q).max() / _TURN)) + 1
        path = np.linspace(q, end, max(count, 2))
        blocked = self._blocked(path, opening, obstacles, None)
        return [Leg(path, CAREFUL)] if blocked is None else blocked

    def follow(self, legs: Sequence[Leg], q: Array, t: float) -> JointTrajectory:
        """Return a trajectory along legs.

        Args:
            legs: the legs.
            q: where the arm is, shape (nv,) [rad]; the first knot.
            t: when it begins [s].
        """
        times, knots = [t], [np.asarray(q, dtype=np.float64)]
        for leg in legs:
            path = np.concatenate([knots[-1][np.newaxis], leg.q])
            duration = self._duration(path, leg.pace)
            count = max(int(np.ceil(duration / _KNOT)), 4)
            s = np.linspace(0, 1, count + 1)[1:]
            eased = s**3 * (10 - 15 * s + 6 * s**2)
            along = _arc(path)
            times += (times[-1] + duration * s).tolist()
            knots += list(np.column_stack([np.interp(eased, along, column) for column in path.T]))
        return JointTrajectory(times, np.array(knots))

    def _blocked(
        self, path: Array, opening: float, obstacles: Sequence[Obstacle], held: Array | None
    ) -> Refusal | None:
        """Return what a path comes too near to; the gap at its start is one that it may keep."""
        gap = self.clearance.gap(path, opening, obstacles, held)
        now = self.clearance.gap(path[0], opening, obstacles, held)
        if gap.distance >= min(MARGIN, now.distance):
            return None
        return Refusal(
            Failure.BLOCKED,
            f"the way would come within {1000 * gap.distance:.0f} mm of {gap.name}",
        )

    def _legs(self, points: Sequence[Array]) -> list[Leg] | str:
        legs: list[Leg] = []
        for first, last in pairwise(points):
            if np.linalg.norm(last - first) < 1e-4:
                continue
            leg = self.line(first, last, BRISK)
            if isinstance(leg, str):
                return leg
            legs.append(leg)
        return legs

    def _duration(self, path: Array, pace: Pace) -> float:
        turned = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
        points = np.array([self.tool(q) for q in path])
        moved = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        speed = np.minimum(pace.joint_speed, self.robot.limits.v_max.min() * 0.6)
        return max(_PEAK * turned / float(speed), _PEAK * moved / pace.hand_speed, _SHORTEST)


def _arc(path: Array) -> Array:
    """Return the share of a path's length at each of its points, shape (k,)."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1) + 1e-12
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(along / along[-1])


def _cylindrical(point: ArrayLike) -> Array:
    x, y, z = np.asarray(point, dtype=np.float64)
    return np.array([np.arctan2(y, x), np.hypot(x, y), z])


def lifted(point: Array) -> Array:
    """Return a point at the height at which the hand travels, or higher, shape (3,) [m]."""
    return _raised(point, LIFTED)


def _raised(point: Array, height: float) -> Array:
    return np.array([point[0], point[1], max(float(point[2]), height)])

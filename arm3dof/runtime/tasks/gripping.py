"""Which things can be grasped, and where they can be put: the region, with a reason.

The arm's last joint moves in the vertical plane through its base, so where the tool is decides how
the forearm slants: 80 degrees down near the base, and nearly level at full stretch. The
fingers close across that plane. A thing can be grasped where

- it is seen whole, and fits between the fingers, with room for what is not known about its place;
- the tool reaches a point on its axis with the elbow up, so that the forearm slants down to it;
- at some height on the thing the fingertips stay off the table, the palm stays off the thing's
  top, and the pads still hold enough of it;
- neither hand nor forearm touches other things, also on the way along the forearm.

What is held keeps its angle to the forearm. So a place nearer or farther than where it was picked
up tilts it, by the difference of the two slants; put down, it rocks onto its foot about the edge
that touches first, and that is allowed for, as long as it does not topple.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from arm3dof.model.gripper import find_gripper
from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.clearance import TABLE, Clearance, Gap, Obstacle, held_points
from arm3dof.runtime.tasks.machine import Failure, Refusal
from arm3dof.runtime.tasks.route import CAREFUL, MARGIN, Leg, Planner
from arm3dof.state import Array
from arm3dof.vision.standing import Standing

SIGMAS = 2.0
"""How many standard deviations of a thing's place must fit between the fingers."""
ROOM = 0.012
"""How much farther than its width the fingers open around a thing among others [m]; where there is
space, twice that."""

_SLACK = 0.0015  # of the fingers beside a thing, beyond the uncertainty [m]
_TOUCH = 0.001  # least gap between the hand and the thing on the way to it [m]
_BACK = 0.055  # from the grasp back along the forearm to the pregrasp [m]
_LOWEST, _STEP = 0.014, 0.002  # heights to grasp at, above the table [m]
_BEST = 0.55  # height to grasp at, as a share of the thing's
_ABOVE = 0.009  # how far above a thing's top the tool's point may be: the pads reach lower [m]
_FOOTROOM = 0.0015  # between what is put down and the table [m]
_TOPPLES = 0.7  # share of the angle at which a thing topples to which it may be tilted


@dataclass(frozen=True, eq=False)
class Grip:
    """How a thing is grasped.

    Attributes:
        thing: the thing.
        q: configuration at the grasp, shape (nv,) [rad].
        point: where the tool is then, shape (3,) [m].
        height: how far that is above the thing's foot [m].
        opening: of the fingers on the way there [m].
        reach: from the pregrasp along the forearm to the grasp.
        pitch: of the forearm at the grasp [rad].
    """

    thing: Standing
    q: Array
    point: Array
    height: float
    opening: float
    reach: Leg
    pitch: float

    def held(self, planner: Planner) -> Array:
        """Return points of the thing in the tool frame once it is held, shape (n, 3) [m]."""
        pose: pin.SE3 = planner.robot.placement(self.q)
        return held_points(self.thing.width_m, self.thing.height_m, self.height, pose)


@dataclass(frozen=True, eq=False)
class Placing:
    """How a thing is put down.

    Attributes:
        point: where the tool opens, shape (3,) [m].
        tilt: how far the thing leans towards or away from the arm then [rad].
        retreat: back along the forearm.
    """

    point: Array
    tilt: float
    retreat: Leg


class Gripping:
    """Says how an arm grasps a thing and puts it down, or why it cannot."""

    def __init__(self, robot: Robot, table_height: float) -> None:
        """Take up an arm on a table.

        Args:
            robot: a robot with a gripper of two sliding fingers.
            table_height: of the table in the base frame [m].
        """
        self.table_height = table_height
        self.planner = Planner(robot, Clearance(robot, table_height))
        gripper = find_gripper(robot)
        self.widest = 0.0 if gripper is None else gripper.opening

    def obstacle(self, thing: Standing) -> Obstacle:
        """Return a thing as something to keep clear of."""
        top = self.table_height + thing.height_m
        name = f"{thing.target} at ({thing.x:.3f}, {thing.y:.3f}) m"
        return Obstacle(name, thing.x, thing.y, thing.width_m / 2, top)

    def grip(self, thing: Standing, others: Sequence[Obstacle] = ()) -> Grip | Refusal:
        """Return how to grasp a thing among others, or why it cannot be grasped."""
        if thing.hidden:
            return Refusal(
                Failure.PARTLY_HIDDEN,
                f"what is seen of it near ({thing.x:.3f}, {thing.y:.3f}) m is not the outline of "
                "an upright thing; take away what stands before it, or set it up",
            )
        needed = thing.width_m + 2 * _SLACK
        if needed > self.widest:
            return Refusal(
                Failure.TOO_WIDE,
                f"it is {1000 * thing.width_m:.0f} mm wide, the fingers open "
                f"{1000 * self.widest:.0f} mm",
            )
        allowed = (self.widest - needed) / 2 / SIGMAS + _SLACK
        if thing.sigma_m > allowed:
            return Refusal(
                Failure.TOO_UNCERTAIN,
                f"sigma {1000 * thing.sigma_m:.0f} mm > {1000 * allowed:.0f} mm; move the camera "
                "nearer or calibrate it",
            )
        room = needed + 2 * SIGMAS * thing.sigma_m
        openings = sorted({min(room + extra, self.widest) for extra in (ROOM, 2 * ROOM)})
        refusal = Refusal(Failure.OUT_OF_REACH, "the thing is too low for the fingers")
        for opening in reversed(openings):
            for height in self._heights(thing):
                found = self._try(thing, height, opening, others)
                if isinstance(found, Grip):
                    return found
                refusal = found
        return refusal

    def placing(
        self, grip: Grip, x: float, y: float, others: Sequence[Obstacle] = (), floor: float = 0.0
    ) -> Placing | Refusal:
        """Return how to put down what is held, or why it cannot be put down.

        Args:
            grip: how it is held.
            x: of the place in the base frame [m].
            y: of the place [m].
            others: what stands around.
            floor: how far above the table it is to be let go [m].
        """
        solved = self._aim(grip, x, y, floor)
        if isinstance(solved, Refusal):
            return solved
        point, q, tilt = solved
        width, height = grip.thing.width_m, grip.thing.height_m
        most = _TOPPLES * math.atan2(width, height)
        if abs(tilt) > most and floor == 0.0:
            return Refusal(
                Failure.OUT_OF_REACH,
                f"put down at ({x:.3f}, {y:.3f}) m it would lean by "
                f"{abs(math.degrees(tilt)):.0f} degrees and may topple; choose a place about "
                f"{math.hypot(*grip.point[:2]):.2f} m from the base",
            )
        bottom = self.table_height + floor
        for it in others:
            if it.top > bottom and math.hypot(it.x - x, it.y - y) < it.radius + width / 2:
                line = f"at the place, ({x:.3f}, {y:.3f}) m, stands {it.name}; choose another"
                return Refusal(Failure.BLOCKED, line)
        opening = min(width + ROOM, self.widest)
        back = self.planner.line(point, point - _BACK * self.planner.forearm(q), CAREFUL)
        if isinstance(back, str):
            return Refusal(Failure.OUT_OF_REACH, back)
        gap = self.planner.clearance.gap(back.q, opening, others)
        if gap.distance < MARGIN:
            return self._blocked(gap, "putting it down")
        return Placing(point, tilt, back)

    def _heights(self, thing: Standing) -> list[float]:
        """Return heights on a thing to grasp at, the best first [m]."""
        heights = np.arange(_LOWEST, thing.height_m + _ABOVE, _STEP)
        best = _BEST * thing.height_m
        return sorted(heights.tolist(), key=lambda height: abs(height - best))

    def _try(
        self, thing: Standing, height: float, opening: float, others: Sequence[Obstacle]
    ) -> Grip | Refusal:
        planner = self.planner
        point = np.array([thing.x, thing.y, self.table_height + height])
        q = planner.solve(point)
        if isinstance(q, str):
            return Refusal(Failure.OUT_OF_REACH, q)
        start = point - _BACK * planner.forearm(q)
        reach = planner.line(start, point, CAREFUL)
        if isinstance(reach, str):
            return Refusal(Failure.OUT_OF_REACH, reach)
        own = planner.clearance.gap(reach.q, opening, (self.obstacle(thing),))
        if own.name == TABLE and own.distance < MARGIN:
            return Refusal(
                Failure.OUT_OF_REACH,
                f"the fingertips would come within {1000 * own.distance:.0f} mm of the table",
            )
        if own.distance < _TOUCH:
            return Refusal(
                Failure.OUT_OF_REACH,
                f"the hand would touch the thing, which is {1000 * thing.height_m:.0f} mm high",
            )
        gap = planner.clearance.gap(reach.q, opening, others)
        if gap.distance < MARGIN:
            return self._blocked(gap, "grasping it")
        return Grip(thing, q, point, height, opening, reach, planner.pitch(q))

    def _aim(
        self, grip: Grip, x: float, y: float, floor: float
    ) -> tuple[Array, Array, float] | Refusal:
        """Return where the tool lets go, the configuration, and how far the thing leans then."""
        radius, azimuth = math.hypot(x, y), math.atan2(y, x)
        half, below, tilt = grip.thing.width_m / 2, grip.height, 0.0
        point, q = grip.point, grip.q
        for _ in range(4):
            # upright again, its foot is this much farther out than the tool was
            shift = below * math.sin(tilt) + math.copysign(half * (1 - math.cos(tilt)), tilt)
            drop = below * math.cos(tilt) + half * abs(math.sin(tilt))
            at = radius - shift
            z = self.table_height + floor + drop + _FOOTROOM
            point = np.array([at * math.cos(azimuth), at * math.sin(azimuth), z])
            solved = self.planner.solve(point)
            if isinstance(solved, str):
                return Refusal(Failure.OUT_OF_REACH, f"its place: {solved}")
            q, tilt = solved, self.planner.pitch(solved) - grip.pitch
        return point, q, tilt

    def _blocked(self, gap: Gap, doing: str) -> Refusal:
        return Refusal(
            Failure.BLOCKED, f"{doing}, the hand would come within {1000 * gap.distance:.0f} mm "
            f"of {gap.name}"
        )  # fmt: skip


def graspable(robot: Robot, thing: Standing, table_height: float) -> Grip | Refusal:
    """Return how an arm grasps a thing that stands alone on the table, or why it cannot.

    Args:
        robot: a robot with a gripper of two sliding fingers.
        thing: the thing.
        table_height: of the table in the base frame [m].
    """
    return Gripping(robot, table_height).grip(thing)

"""A gripper: the fingers that a robot's model holds still and that a physics engine moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from arm3dof.model.build import robot_from_description
from arm3dof.model.robot import Description, Robot
from arm3dof.model.tree import placement
from arm3dof.model.urdf import Joint, read_urdf


@dataclass(frozen=True)
class Finger:
    """One finger of a gripper.

    Attributes:
        joint: name of its prismatic joint.
        link: name of the link that it carries, whose origin lies on the pad's face.
        multiplier: how far it goes for each metre of the driven finger.
        offset: its position where the driven finger is at 0 [m].
    """

    joint: str
    link: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Gripper:
    """Two fingers that slide, moved by one servo.

    Attributes:
        driven: the finger whose joint the servo drives.
        follower: the finger that is coupled to it.
        q_open: position of the driven joint at which the fingers are farthest apart [m].
        q_closed: position at which they are nearest [m].
        opening: distance of the fingers' frames along their travel when open [m].
        closed: that distance when closed [m].
        effort: the servo's highest force on the driven joint, which moves both fingers [N].
        speed: highest speed of the driven joint [m/s].
    """

    driven: Finger
    follower: Finger
    q_open: float
    q_closed: float
    opening: float
    closed: float
    effort: float
    speed: float

    @property
    def joints(self) -> tuple[str, str]:
        """Names of both joints, the driven one first."""
        return self.driven.joint, self.follower.joint

    def position_of(self, opening: float) -> float:
        """Return the driven joint's position [m] for a distance of the fingers [m].

        A distance that the gripper cannot have is taken as the nearest that it can.
        """
        low, high = sorted((self.closed, self.opening))
        share = (min(max(opening, low), high) - self.closed) / (self.opening - self.closed)
        return self.q_closed + share * (self.q_open - self.q_closed)

    def opening_of(self, driven: float, follower: float | None = None) -> float:
        """Return the distance of the fingers [m] at positions of their joints [m].

        Args:
            driven: position of the driven joint.
            follower: position of the other one; where the coupling puts it when None.
        """
        follow = self.follower
        if follower is None:
            follower = follow.multiplier * driven + follow.offset
        at_closed = follow.multiplier * self.q_closed + follow.offset
        opens = math.copysign(1.0, self.q_open - self.q_closed)
        other = math.copysign(opens, opens * follow.multiplier) * (follower - at_closed)
        return self.closed + opens * (driven - self.q_closed) + other


def find_gripper(robot: Robot) -> Gripper | None:
    """Find the gripper that a robot's description holds still; None where there is none.

    It is two locked prismatic joints on one link: one that mimics the other, or two that nothing
    couples and that are then moved alike (the panda's).
    """
    urdf, _ = read_urdf(robot.description.urdf)
    if urdf is None:
        return None
    locked = robot.description.locked_joints
    sliding = [j for j in urdf.moving_joints if j.kind == "prismatic" and j.name in locked]
    for follower in sliding:
        for driven in sliding:
            if follower.mimics is not None and follower.mimics.joint == driven.name:
                mimic = follower.mimics
                finger = Finger(follower.name, follower.child, mimic.multiplier, mimic.offset)
                return _gripper(driven, follower, finger)
    if len(sliding) == 2 and sliding[0].parent == sliding[1].parent:
        driven, follower = sliding
        return _gripper(driven, follower, Finger(follower.name, follower.child))
    return None


def with_free_gripper(robot: Robot, gripper: Gripper) -> Robot:
    """Return the same robot, payload included, with its fingers as joints of their own.

    What couples them is left out: it is for the physics engine to keep them together.
    """
    description = robot.description
    locked = {k: q for k, q in description.locked_joints.items() if k not in gripper.joints}
    return _rebuilt(description, locked, robot.tool_frame)


def with_gripper_at(robot: Robot, opening: float) -> Robot:
    """Return the same robot with its fingers held so far apart [m]; itself where it has none."""
    gripper = find_gripper(robot)
    if gripper is None:
        return robot
    q = gripper.position_of(opening)
    other = gripper.follower.multiplier * q + gripper.follower.offset
    at = dict(zip(gripper.joints, (q, other), strict=True))
    locked = {**robot.description.locked_joints, **at}
    description = replace(robot.description, locked_joints=locked)
    return robot_from_description(description, robot.tool_frame)


def _rebuilt(description: Description, locked: Mapping[str, float], tool: str) -> Robot:
    root = ElementTree.fromstring(description.urdf)
    for joint in root.iter("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    text = ElementTree.tostring(root, encoding="unicode")
    return robot_from_description(replace(description, urdf=text, locked_joints=locked), tool)


def _gripper(driven: Joint, follower: Joint, finger: Finger) -> Gripper:
    def distance(q: float) -> float:
        ends = (q, finger.multiplier * q + finger.offset)
        first, second = (
            placement(joint, at).translation
            for joint, at in zip((driven, follower), ends, strict=True)
        )
        along = placement(driven, 0.0).rotation @ (driven.axis / np.linalg.norm(driven.axis))
        return abs(float(along @ (second - first)))

    ends = sorted((driven.lower, driven.upper), key=distance)
    return Gripper(
        driven=Finger(driven.name, driven.child),
        follower=finger,
        q_open=ends[1],
        q_closed=ends[0],
        opening=distance(ends[1]),
        closed=distance(ends[0]),
        effort=driven.effort,
        speed=driven.velocity,
    )

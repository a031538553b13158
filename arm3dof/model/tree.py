"""The tree that a URDF's links and joints form: is it one, and what hangs together in it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from arm3dof.errors import FrameNotFound, Problem
from arm3dof.model.urdf import Joint, Link, Urdf
from arm3dof.state import Array

_RESERVED = "universe"


def tree_problems(urdf: Urdf) -> tuple[Problem, ...]:
    """Return what keeps links and joints from forming one tree with one root.

    Args:
        urdf: a robot that was read.
    """
    if not urdf.links:
        return (Problem(f"robot '{urdf.name}'", "has no links", "add <link> elements"),)
    ends = tuple(_end_problems(urdf))
    shape = () if ends else _shape_problems(urdf)  # a joint that leads nowhere spoils the shape
    return (*_name_problems(urdf), *ends, *shape)


def _name_problems(urdf: Urdf) -> Iterator[Problem]:
    for kind, parts in (("link", urdf.links), ("joint", urdf.joints)):
        for name, count in Counter(part.name for part in parts).items():
            if name and count > 1:
                what = f"is defined {count} times"
                yield Problem(f"{kind} '{name}'", what, f"give each {kind} a name of its own")
            if name == _RESERVED:
                yield Problem(f"{kind} '{name}'", "is a reserved name", "rename it")


def _end_problems(urdf: Urdf) -> Iterator[Problem]:
    known = {link.name for link in urdf.links}
    for joint in urdf.joints:
        for role, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in known or not name:
                what = f"{role} link '{name}' does not exist" if name else f"has no {role} link"
                cure = f'name one of the robot\'s links: <{role} link="..."/>'
                yield Problem(f"joint '{joint.name}'", what, cure)


def _shape_problems(urdf: Urdf) -> Iterator[Problem]:
    parents: dict[str, list[str]] = defaultdict(list)
    children: dict[str, list[str]] = defaultdict(list)
    for joint in urdf.joints:
        parents[joint.child].append(joint.name)
        children[joint.parent].append(joint.child)
    for link in urdf.links:
        if len(parents[link.name]) > 1:
            what = f"is the child of several joints: {', '.join(parents[link.name])}"
            yield Problem(f"link '{link.name}'", what, "leave it one parent (no loops)")
    roots = [link.name for link in urdf.links if not parents[link.name]]
    if len(roots) > 1:
        what = f"has several root links: {', '.join(roots)}"
        yield Problem(f"robot '{urdf.name}'", what, "join all but one to the tree by a joint")
    reached, todo = set(roots), list(roots)
    while todo:
        fresh = [name for name in children[todo.pop()] if name not in reached]
        reached.update(fresh)
        todo += fresh
    loop = [link.name for link in urdf.links if link.name not in reached]
    if loop:
        cure = "remove the joint that closes the loop"
        yield Problem(f"links {', '.join(loop)}", "hang on one another in a loop", cure)


# ---- walking a tree that is one ----------------------------------------------------------------


@dataclass(frozen=True)
class Body:
    """Links that move as one: a link moved by a joint, and all that is fixed or locked to it.

    Attributes:
        joint: the joint that moves it; None for the base.
        parts: its links, each with its pose in the first one's frame.
    """

    joint: Joint | None
    parts: tuple[tuple[Link, pin.SE3], ...]

    @property
    def name(self) -> str:
        """Name of the first link."""
        return self.parts[0][0].name


def bodies(urdf: Urdf, locked: Mapping[str, float]) -> tuple[Body, ...]:
    """Return the base and the moving bodies of a sound tree, parents before children.

    Args:
        urdf: a robot without ``tree_problems``.
        locked: joints held fixed, and their positions [rad or m].
    """
    links = {link.name: link for link in urdf.links}
    below: dict[str, list[Joint]] = defaultdict(list)
    for joint in urdf.joints:
        below[joint.parent].append(joint)
    starts: list[tuple[Joint | None, str]] = [(None, root_link(urdf))]
    found = []
    for moved_by, name in starts:  # grows while it is walked
        parts = [(links[name], pin.SE3.Identity())]
        for link, pose in parts:  # grows as well
            for joint in below[link.name]:
                if joint.moves and joint.name not in locked:
                    starts.append((joint, joint.child))
                else:
                    fixed = pose * placement(joint, locked.get(joint.name, 0.0))
                    parts.append((links[joint.child], fixed))
        found.append(Body(moved_by, tuple(parts)))
    return tuple(found)


def root_link(urdf: Urdf) -> str:
    """Return the name of the link that is nobody's child, in a sound tree."""
    children = {joint.child for joint in urdf.joints}
    return next(link.name for link in urdf.links if link.name not in children)


def chain_to(urdf: Urdf, link: str) -> tuple[Joint, ...]:
    """Return the joints from the root to a link of a sound tree, the root's first."""
    above = {joint.child: joint for joint in urdf.joints}
    chain: list[Joint] = []
    while link in above:
        chain.append(above[link])
        link = above[link].parent
    return tuple(reversed(chain))


def link_of_frame(urdf: Urdf, frame: str) -> str:
    """Return the link at which a frame lies: itself, or the child of the joint of that name.

    Raises:
        FrameNotFound: the robot has no such frame.
    """
    links = [link.name for link in urdf.links]
    carried = {joint.name: joint.child for joint in urdf.joints}
    if frame not in links and frame not in carried:
        raise FrameNotFound(frame, links)
    return frame if frame in links else carried[frame]


def placement(joint: Joint, position: float) -> pin.SE3:
    """Return the pose of a joint's child in its parent link, at a position [rad or m]."""
    origin = pin.SE3(rotation(joint.rpy), joint.xyz)
    if position == 0.0:
        return origin
    axis = joint.axis / np.linalg.norm(joint.axis)
    if joint.kind == "prismatic":
        return origin * pin.SE3(np.eye(3), position * axis)
    return origin * pin.SE3(pin.AngleAxis(position, axis).toRotationMatrix(), np.zeros(3))


def rotation(rpy: Array) -> Array:
    """Return the rotation matrix of URDF's fixed-axis roll, pitch and yaw, shape (3, 3)."""
    return np.array(pin.rpy.rpyToMatrix(np.asarray(rpy)))

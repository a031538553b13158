"""Judging a URDF before Pinocchio sees it: every problem as where, what and cure.

Pinocchio crashes on some broken files (a link with two parents) and takes others as they come (a
mass of "abc" becomes zero); so a robot is loaded only when nothing is found here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from numbers import Real

import numpy as np

from arm3dof.errors import FrameNotFound, InputError, Problem
from arm3dof.model.tree import Body, bodies, rotation, tree_problems
from arm3dof.model.urdf import Joint, Link, Urdf, read_urdf
from arm3dof.state import Array

_ROUNDING = 1e-3  # files print inertias with few digits: a flat plate may miss by that much
_FLAT = 1e-9  # smallest principal moment against the largest that still counts as positive


def validate_urdf(
    source: str | bytes, locked_joints: Mapping[str, float] | Collection[str] = ()
) -> tuple[Problem, ...]:
    """Return every problem of a URDF, in the order: text, tree, joints, bodies.

    Inertia is judged for each body that moves as one, so that a massless frame that is fixed to
    a link is fine. Joints that are locked need neither limits nor freedom from ``mimic``.

    Args:
        source: the file's text or bytes.
        locked_joints: joints that will be held fixed: their names, or names and positions.

    Raises:
        FrameNotFound: the robot has no movable joint of a name that is to be locked.
        InputError: a locked position is not a number inside the joint's limits.
    """
    urdf, problems = read_urdf(source)
    if urdf is None:
        return problems
    return (*problems, *judge(urdf, lock_positions(urdf, locked_joints)))


def judge(urdf: Urdf, locked: Mapping[str, float]) -> tuple[Problem, ...]:
    """Return the problems of a robot that was read, beyond those that reading found.

    Args:
        urdf: the robot.
        locked: joints held fixed, and their positions [rad or m].
    """
    structure = structure_problems(urdf, locked)
    joints = [problem for joint in _moving(urdf, locked) for problem in _joint_problems(joint)]
    masses = [problem for link in urdf.links for problem in _mass_problems(link)]
    if structure:
        return (*structure, *joints, *masses)
    return (*structure, *joints, *masses, *_inertia_problems(urdf, locked))


def structure_problems(urdf: Urdf, locked: Mapping[str, float]) -> tuple[Problem, ...]:
    """Return the problems that no other number in the file would cure.

    Args:
        urdf: the robot.
        locked: joints held fixed, and their positions [rad or m].
    """
    moving = _moving(urdf, locked)
    found = list(tree_problems(urdf))
    for joint in moving:
        if joint.mimics is not None:
            what = f"mimics '{joint.mimics.joint}', which is not supported"
            cure = f"lock it: locked_joints=['{joint.name}'], or remove its <mimic>"
            found.append(Problem(f"joint '{joint.name}'", what, cure))
    for joint in urdf.moving_joints:
        if np.linalg.norm(joint.axis) < 1e-6:
            cure = 'give a direction, such as <axis xyz="0 0 1"/>'
            found.append(Problem(f"joint '{joint.name}'", "its axis is zero", cure))
    if urdf.links and not moving:
        cure = "give it a revolute or prismatic joint, or lock fewer"
        found.append(Problem(f"robot '{urdf.name}'", "has no joint that moves", cure))
    return tuple(found)


def _moving(urdf: Urdf, locked: Mapping[str, float]) -> list[Joint]:
    return [joint for joint in urdf.moving_joints if joint.name not in locked]


def lock_positions(
    urdf: Urdf, locked_joints: Mapping[str, float] | Collection[str]
) -> dict[str, float]:
    """Return the position at which each locked joint is held [rad or m].

    Args:
        urdf: the robot.
        locked_joints: names and positions, or names (or one name) alone: these are held at 0, or
            at the limit nearest to 0. What mimics a locked joint is held where that puts it,
            unless it is named too.

    Raises:
        FrameNotFound: the robot has no movable joint of that name.
        InputError: a position is not a number inside the joint's limits.
    """
    if isinstance(locked_joints, str):
        locked_joints = (locked_joints,)
    joints = {joint.name: joint for joint in urdf.moving_joints}
    locked = {}
    for name in locked_joints:
        if name not in joints:
            raise FrameNotFound(name, joints, "movable joint")
        joint = joints[name]
        if isinstance(locked_joints, Mapping):
            locked[name] = _checked_position(joint, locked_joints[name])
        else:
            locked[name] = float(np.fmin(np.fmax(0.0, joint.lower), joint.upper))
    return locked | _followers(urdf, locked)


def coupled_joints(urdf: Urdf, named: Collection[str] = ()) -> tuple[str, ...]:
    """Return the movable joints that others mimic and that mimic none: what drives a gripper.

    Args:
        urdf: the robot.
        named: joints to leave out, and with a follower what it follows.
    """
    followed = {
        joint.mimics.joint
        for joint in urdf.moving_joints
        if joint.mimics is not None and joint.name not in named
    }
    return tuple(
        joint.name
        for joint in urdf.moving_joints
        if joint.name in followed.difference(named) and joint.mimics is None
    )


def _followers(urdf: Urdf, locked: Mapping[str, float]) -> dict[str, float]:
    """Return where the joints are held that follow a locked one and are not named themselves."""
    held = dict(locked)
    for _ in urdf.moving_joints:  # a follower may be followed
        for joint in urdf.moving_joints:
            if joint.name not in held and joint.mimics is not None and joint.mimics.joint in held:
                position = joint.mimics.multiplier * held[joint.mimics.joint] + joint.mimics.offset
                held[joint.name] = float(position)
    return {name: position for name, position in held.items() if name not in locked}


def _checked_position(joint: Joint, position: float) -> float:
    low, high = joint.lower, joint.upper
    fits = isinstance(position, Real) and np.isfinite(float(position))
    if not fits or position < low or position > high:
        raise InputError(
            f"locked joint '{joint.name}' is at {position!r}; give a position from {low} to {high}"
        )
    return float(position)


# ---- joints ------------------------------------------------------------------------------------


def _joint_problems(joint: Joint) -> Iterator[Problem]:
    where = f"joint '{joint.name}'"
    if joint.lower >= joint.upper:
        what = f"lower limit {joint.lower:g} is not below upper limit {joint.upper:g}"
        yield Problem(where, what, "swap them, or make the joint fixed if it shall not move")
    for name, value, unit in (
        ("effort", joint.effort, "N" if joint.kind == "prismatic" else "N m"),
        ("velocity", joint.velocity, "m/s" if joint.kind == "prismatic" else "rad/s"),
    ):
        if not value > 0.0:
            what = f"{name} limit is {'missing' if np.isnan(value) else format(value, 'g')}"
            cure = f'give what the motor can do: <limit {name}="..."/> in {unit}, above 0'
            yield Problem(where, what, cure)
    for name, value in (("damping", joint.damping), ("friction", joint.friction)):
        if value < 0.0:
            yield Problem(where, f"{name} {value:g} is negative", "give 0 or more")


# ---- bodies ------------------------------------------------------------------------------------


def _mass_problems(link: Link) -> Iterator[Problem]:
    if link.inertial is not None and link.inertial.mass < 0.0:
        what = f"mass {link.inertial.mass:g} kg is negative"
        yield Problem(f"link '{link.name}'", what, "give its mass in kg, above 0")


def _inertia_problems(urdf: Urdf, locked: Mapping[str, float]) -> Iterator[Problem]:
    for body in bodies(urdf, locked):
        if body.joint is None:
            continue  # the base stands still
        others = ", ".join(link.name for link, _ in body.parts[1:])
        where = f"link '{body.name}'" + (f" (and fixed to it: {others})" if others else "")
        if all(link.inertial is None for link, _ in body.parts):
            yield Problem(where, "moves and has no <inertial>", "add mass, centre and inertia")
            continue
        mass, inertia = body_inertia(body)
        if mass == 0.0:
            yield Problem(where, "moves and has zero mass", "give its mass in kg, above 0")
        elif mass > 0.0 and np.isfinite(inertia).all():
            yield from _tensor_problems(where, inertia)


def _tensor_problems(where: str, inertia: Array) -> Iterator[Problem]:
    small, middle, large = np.linalg.eigvalsh(inertia)
    moments = f"its principal moments are {small:.3g}, {middle:.3g}, {large:.3g} kg m^2"
    cure = "give the inertia about the centre of mass, from CAD or from its shape"
    if small <= _FLAT * abs(large):
        yield Problem(where, f"inertia is not positive definite: {moments}", cure)
    elif small + middle < (1.0 - _ROUNDING) * large:
        what = f"inertia is that of no solid (the largest exceeds the others' sum): {moments}"
        yield Problem(where, what, cure)


def body_inertia(body: Body) -> tuple[float, Array]:
    """Return a body's mass [kg] and inertia about its centre of mass, shape (3, 3) [kg m^2].

    The inertia is along the axes of the body's first link.
    """
    parts = [(link.inertial, pose) for link, pose in body.parts if link.inertial is not None]
    mass = sum(part.mass for part, _ in parts)
    if not mass > 0.0:
        return float(mass), np.zeros((3, 3))
    centres = [pose.act(part.com) for part, pose in parts]
    centre = sum((part.mass * c for (part, _), c in zip(parts, centres, strict=True)), np.zeros(3))
    inertia = np.zeros((3, 3))
    for (part, pose), c in zip(parts, centres, strict=True):
        turn = pose.rotation @ rotation(part.rpy)
        arm = c - centre / mass
        inertia += turn @ part.inertia @ turn.T
        inertia += part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return float(mass), inertia

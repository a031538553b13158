"""What can happen to an arm from outside: pushes, forces, moments and loads."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from arm3dof.errors import FrameNotFound, InputError
from arm3dof.model.payload import Payload, centre_of_mass
from arm3dof.model.robot import Robot
from arm3dof.state import Array, finite_vector

_SMALLEST_SHARE = 1e-9  # a force that acts in less of a step than this only met it by rounding


@dataclass(frozen=True)
class Push:
    """A displacement: at one instant a joint stands elsewhere, its velocity unchanged.

    Attributes:
        t: when [s].
        joint: name of the joint, or its index in ``robot.joint_names``.
        angle: how far it is pushed [rad, or m for a joint that slides].

    Raises:
        InputError: a number is not finite.
    """

    t: float
    joint: str | int
    angle: float

    def __post_init__(self) -> None:
        _check_finite("push", t=self.t, angle=self.angle)


@dataclass(frozen=True, eq=False)
class Wrench:
    """A force and a moment that act on the tool for some time.

    Both keep their direction in the base frame while the tool moves.

    Attributes:
        t: when it begins [s].
        force: force at the tool's origin in base axes, shape (3,) [N].
        torque: moment in base axes, shape (3,) [N m].
        duration: how long it lasts [s].

    Raises:
        InputError: a number is not finite, or the duration is not positive.
    """

    t: float
    force: Array
    torque: Array = field(default_factory=lambda: np.zeros(3))
    duration: float = field(kw_only=True)

    def __post_init__(self) -> None:
        _check_finite("wrench", t=self.t)
        _check_duration("wrench", self.duration)
        for name in ("force", "torque"):
            vector = finite_vector(getattr(self, name), 3, f"the wrench's {name}")
            object.__setattr__(self, name, vector)


@dataclass(frozen=True)
class JointTorque:
    """A moment that the surroundings put on one joint for some time.

    Attributes:
        t: when it begins [s].
        joint: name of the joint, or its index in ``robot.joint_names``.
        torque: moment about the joint's axis [N m, or N for a joint that slides].
        duration: how long it lasts [s].

    Raises:
        InputError: a number is not finite, or the duration is not positive.
    """

    t: float
    joint: str | int
    torque: float
    duration: float

    def __post_init__(self) -> None:
        _check_finite("joint torque", t=self.t, torque=self.torque)
        _check_duration("joint torque", self.duration)


@dataclass(frozen=True)
class PayloadChange:
    """From some time on the tool carries another payload, or none.

    It is taken up and put down at the tool's own velocity: the joints' velocities do not jump.

    Attributes:
        t: when [s].
        mass: point mass [kg]; ``None`` releases what is there.
        com: its place in the tool frame [m].

    Raises:
        InputError: ``t`` is not finite, the mass is negative, or ``com`` is not three numbers.
    """

    t: float
    mass: float | None
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _check_finite("payload change", t=self.t)
        object.__setattr__(self, "com", centre_of_mass(self.com))
        if self.mass is not None:
            Payload(self.mass, self.com)

    def on(self, robot: Robot) -> Robot:
        """Return the robot after the change."""
        if self.mass is None:
            return robot.without_payload()
        return robot.with_payload(self.mass, self.com)


def share_of_step(event: Wrench | JointTorque, t: float, dt: float) -> float:
    """Return the share of the step from ``t`` to ``t + dt`` in which an event acts.

    Args:
        event: the event.
        t: begin of the step [s].
        dt: its length [s].
    """
    share = (min(t + dt, event.t + event.duration) - max(t, event.t)) / dt
    if share < _SMALLEST_SHARE:
        return 0.0
    return 1.0 if share > 1 - _SMALLEST_SHARE else share


def joint_axis(robot: Robot, joint: str | int) -> Array:
    """Return the unit vector of a joint, shape (nv,).

    Args:
        robot: the robot.
        joint: name of the joint, or its index in ``robot.joint_names``.

    Raises:
        FrameNotFound: the robot has no joint of that name.
        InputError: it has no joint of that index.
    """
    names = robot.joint_names
    if isinstance(joint, str):
        if joint not in names:
            raise FrameNotFound(joint, names, "joint")
        joint = names.index(joint)
    elif not 0 <= joint < len(names):
        raise InputError(f"joint is {joint}; give an index from 0 to {len(names) - 1}, or a name")
    axis = np.zeros(len(names))
    axis[joint] = 1.0
    return axis


def _check_finite(what: str, **values: float) -> None:
    for name, value in values.items():
        if not np.isfinite(value):
            raise InputError(f"the {what}'s {name} is {value!r}; give a finite number")


def _check_duration(what: str, duration: float) -> None:
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"the {what}'s duration is {duration!r}; give a time above 0 s")

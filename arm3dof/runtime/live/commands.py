"""What may be asked of the arm: small frozen values that cross from the page's process to its own.

Every number is checked where the command is made, so that a bad one is refused on the page and
never reaches the arm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from arm3dof.control.settings import MpcSettings
from arm3dof.control.tuning import Gains
from arm3dof.errors import InputError
from arm3dof.runtime.parallel import PackedRobot

ControllerName = Literal["mpc", "computed-torque", "pd-gravity", "pid", "pd"]
CONTROLLERS: tuple[ControllerName, ...] = get_args(ControllerName)


@dataclass(frozen=True)
class Run:
    """Drive the arm to its target."""


@dataclass(frozen=True)
class Stop:
    """Brake to rest as fast as the torque allows, then hold there.

    Attributes:
        why: what made it necessary, for the status line; empty when a person asked.
    """

    why: str = ""


@dataclass(frozen=True)
class Pause:
    """Freeze the world's time, or let it go on.

    Attributes:
        paused: whether time stands still.
    """

    paused: bool


@dataclass(frozen=True)
class StepOnce:
    """Let the time that stands still go on for one control step."""


@dataclass(frozen=True)
class Aim:
    """Choose where to go.

    Attributes:
        q_target: joint positions [rad].
    """

    q_target: tuple[float, ...]

    def __post_init__(self) -> None:
        _finite("the target", *self.q_target)


@dataclass(frozen=True)
class Push:
    """Push a joint for a while, as a hand would.

    Attributes:
        joint: index of the joint.
        torque: moment about its axis [N m, or N for a joint that slides].
        duration: how long it lasts [s].
    """

    joint: int
    torque: float
    duration: float = 0.2

    def __post_init__(self) -> None:
        _finite("the push", self.torque, self.duration)


@dataclass(frozen=True)
class Load:
    """Hang a point mass on the tool, unknown to the controller.

    Attributes:
        mass: the payload [kg]; 0 takes it off.
    """

    mass: float

    def __post_init__(self) -> None:
        _finite("the payload", self.mass)
        if self.mass < 0:
            raise InputError(f"the payload is {self.mass} kg; give 0 or more")


@dataclass(frozen=True)
class Grip:
    """Open or close the fingers.

    Attributes:
        opening: distance between the fingers [m].
    """

    opening: float

    def __post_init__(self) -> None:
        _finite("the opening", self.opening)


@dataclass(frozen=True)
class Do:
    """Let the arm carry out a task by itself.

    Attributes:
        task: which one.
        target: name of the kind of object that is grasped; nothing for sorting.
        place: where it is put down, (x, y) in the base frame [m].
    """

    task: Literal["grasp", "sort"]
    target: str = ""
    place: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _finite("the place", *self.place)


@dataclass(frozen=True)
class Control:
    """Choose the controller.

    Attributes:
        controller: which one.
        mpc: settings of ``MpcSettings`` that differ from its defaults, by name.
        delay: time from a command to its torque in the simulated motors [s]; the controller is
            told of it through ``mpc["delay"]`` or not at all.
        gains: what PD, PD + gravity and PID need; they take seconds to find, which the arm does
            not have, so they come along.
    """

    controller: ControllerName = "mpc"
    mpc: Mapping[str, Any] = field(default_factory=dict)
    delay: float = 0.0
    gains: Gains | None = None

    def __post_init__(self) -> None:
        if self.controller not in CONTROLLERS:
            raise InputError(
                f"controller is {self.controller!r}; give one of: {', '.join(CONTROLLERS)}"
            )
        _finite("the delay", self.delay)
        if not 0 <= self.delay <= 0.5:
            raise InputError(f"the delay is {self.delay} s; give 0 to 0.5 s")
        if self.needs_gains and self.gains is None:
            raise InputError(f"{self.controller} has no gains; give those of tune_gains")
        self.settings()

    @property
    def needs_gains(self) -> bool:
        """Whether the controller has gains that are found by ``tune_gains``."""
        return self.controller in ("pd", "pd-gravity", "pid")

    def settings(self) -> MpcSettings:
        """Return the settings of model predictive control.

        Raises:
            InputError: a setting is outside its domain.
        """
        return MpcSettings(**self.mpc)


@dataclass(frozen=True)
class Rebuild:
    """Go on with an arm of other parameters.

    Attributes:
        robot: the arm; it has as many joints as before.
        version: number of this change, repeated in every frame from then on.
        told: whether the controller's model changes too, or the real arm alone.
    """

    robot: PackedRobot
    version: int
    told: bool = True


@dataclass(frozen=True)
class Restart:
    """Put the arm back to its start, at rest, and everything on the table to its place."""


@dataclass(frozen=True)
class Alive:
    """The page is there; without this word for a while the arm brakes."""


Command = (
    Run
    | Stop
    | Pause
    | StepOnce
    | Aim
    | Push
    | Load
    | Grip
    | Do
    | Control
    | Rebuild
    | Restart
    | Alive
)


def _finite(what: str, *values: float) -> None:
    if not all(math.isfinite(value) for value in values):
        raise InputError(f"{what} is {values}; give finite numbers")

"""What a task is told, and what it asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from arm3dof.control.reference import Target
from arm3dof.vision.standing import Standing


class Gripper(Protocol):
    """What a gripper's servo says of itself."""

    @property
    def opening(self) -> float:
        """Distance of the pads [m]."""

    @property
    def moving(self) -> bool:
        """Whether its set-point is still on its way."""


@dataclass(frozen=True, eq=False)
class Sight:
    """The things on the table in one picture.

    Attributes:
        things: what stands there.
        taken_at: when the picture was taken [s].
    """

    things: tuple[Standing, ...]
    taken_at: float


@dataclass(frozen=True, eq=False)
class Command:
    """What a task asks for until the next tick.

    Attributes:
        target: where the joints are to be.
        opening: of the gripper [m].
        payload: what is held, as far as it is known [kg].
        looking: whether pictures are wanted.
    """

    target: Target
    opening: float
    payload: float
    looking: bool

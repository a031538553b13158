"""The bodies that the live world can be made of: what moves, and what else stands on the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.signals import Gripper
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.plant import Plant
from arm3dof.state import Array, JointState

PLANT_DT = 1e-3
"""Time of one step of the simulated world [s]."""


class LivePlant(Plant, Protocol):
    """An arm among things, that can be pushed, loaded and rebuilt while it moves."""

    @property
    def opening(self) -> float:
        """Distance between the fingers [m]; NaN for an arm without."""

    @property
    def bodies(self) -> Array:
        """Pose of each object: (x, y, z, qw, qx, qy, qz), shape (n, 7) [m]."""

    @property
    def gripper(self) -> Gripper:
        """What the gripper says of itself."""

    @property
    def fingers(self) -> Array:
        """Positions of the two fingers, shape (2,) [m]; NaN for an arm without."""

    def step(self, tau: ArrayLike, *, external_torque: ArrayLike | None = None) -> JointState:
        """Hold a torque for ``dt`` while the surroundings push; return the state after it.

        Args:
            tau: torque that is commanded, shape (nv,) [N m].
            external_torque: torque that the surroundings add, shape (nv,) [N m].
        """

    def change_robot(self, robot: Robot) -> None:
        """Go on with an arm of other masses, lengths or limits."""

    def grip(self, opening: float) -> None:
        """Command the distance between the fingers [m]."""

    def restart(self, q: Array) -> None:
        """Put the arm to a position, at rest, and everything else to its place; time goes on."""


@dataclass(frozen=True)
class NoGripper:
    """What an arm without fingers says of them."""

    opening: float = 0.0
    moving: bool = False


class RigidPlant(PinocchioPlant):
    """The arm alone, as Pinocchio simulates it: nothing to grasp, and no fingers."""

    def __init__(self, robot: Robot, dt: float = PLANT_DT) -> None:
        """Create a plant at rest in the middle of the joint range."""
        super().__init__(robot, dt, end_stops=True)
        self.opening = float("nan")
        self.bodies: Array = np.zeros((0, 7))
        self.fingers: Array = np.full(2, np.nan)
        self.gripper: Gripper = NoGripper()

    def grip(self, opening: float) -> None:
        """Do nothing: there are no fingers."""

    def restart(self, q: Array) -> None:
        """Put the arm to a position, at rest; time goes on."""
        self.reset(JointState(self.state.t, q, np.zeros(self.robot.nv)))

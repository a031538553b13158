"""The bodies that the live world can be made of: what moves, and what else stands on the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.signals import Gripper
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import Array, JointState

PLANT_DT = 1e-3
"""Time of one step of the simulated world [s]."""


class LivePlant(Protocol):
    """An arm among things, that can be pushed, loaded and rebuilt while it moves."""

    @property
    def robot(self) -> Robot:
        """The arm as it truly is, with what it carries."""

    @property
    def dt(self) -> float:
        """Time of one step [s]."""

    @property
    def state(self) -> JointState:
        """The present state, as it truly is."""

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

    def measure(self) -> JointState:
        """Return the present state as the sensors tell it."""

    def step(self, tau: Array, push: Array) -> Array:
        """Hold a torque, and a push from outside, for ``dt``; return what the motors gave.

        Args:
            tau: torque that is commanded, shape (nv,) [N m].
            push: torque that the surroundings add, shape (nv,) [N m].
        """

    def change_robot(self, robot: Robot) -> None:
        """Go on with an arm of other masses, lengths or limits."""

    def grip(self, opening: float) -> None:
        """Command the distance between the fingers [m]."""

    def restart(self, q: Array) -> None:
        """Put the arm to a position, at rest, and everything else to its place."""


@dataclass(frozen=True)
class NoGripper:
    """What an arm without fingers says of them."""

    opening: float = 0.0
    moving: bool = False


class RigidPlant:
    """The arm alone, as Pinocchio simulates it: nothing to grasp, and no fingers."""

    def __init__(self, robot: Robot, dt: float = PLANT_DT) -> None:
        """Create a plant at rest in the middle of the joint range."""
        self._plant = PinocchioPlant(robot, dt, end_stops=True)
        self.opening = float("nan")
        self.bodies: Array = np.zeros((0, 7))
        self.fingers: Array = np.full(2, np.nan)
        self.gripper: Gripper = NoGripper()

    @property
    def robot(self) -> Robot:
        """The arm as it truly is."""
        return self._plant.robot

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self._plant.dt

    @property
    def state(self) -> JointState:
        """The present state."""
        return self._plant.state

    def measure(self) -> JointState:
        """Return the present state."""
        return self._plant.measure()

    def step(self, tau: Array, push: Array) -> Array:
        """Hold a torque and a push for ``dt``; return what the motors gave."""
        self._plant.step(tau, external_torque=push if push.any() else None)
        return self._plant.applied_torque

    def change_robot(self, robot: Robot) -> None:
        """Go on with another arm of as many joints."""
        self._plant.change_robot(robot)

    def grip(self, opening: float) -> None:
        """Do nothing: there are no fingers."""

    def restart(self, q: Array) -> None:
        """Put the arm to a position, at rest; time goes on."""
        self._plant.reset(JointState(self.state.t, q, np.zeros(self.robot.nv)))

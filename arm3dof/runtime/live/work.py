"""Tasks in the live world: grasp a thing, or sort all, asked once a control step."""

from __future__ import annotations

import numpy as np

from arm3dof.control.mpc import MpcController
from arm3dof.control.reference import JointTrajectory
from arm3dof.control.step import ControlStep
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.plants import LivePlant
from arm3dof.runtime.tasks.goals import Goal, Grasping, Sorting, Tray
from arm3dof.runtime.tasks.gripping import Gripping
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.pick_and_place import PickAndPlace
from arm3dof.runtime.tasks.run import TASK_SETTINGS
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World
from arm3dof.state import Array, JointState

PHASES = tuple(Phase)
_BELIEVED_MASS = 0.02  # of a thing [kg]
_LONGEST = {"grasp": 60.0, "sort": 240.0}  # [s]


class Work:
    """A task that the arm is carrying out.

    Attributes:
        dt: time between two control steps [s].
        target: where the joints are to be in the end, shape (nv,) [rad].
    """

    def __init__(
        self, do: cmd.Do, robot: Robot, gripping: Gripping, home: Array, world: World
    ) -> None:
        """Begin.

        Args:
            do: what is to be done.
            robot: the arm as its controller knows it.
            gripping: what says how things are grasped.
            home: where the arm waits while the camera looks, shape (nv,) [rad].
            world: what is known of the surroundings: the bins.
        """
        self.dt = TASK_SETTINGS.dt
        self.target = home
        self._robot, self._payload = robot, 0.0
        self._controller = MpcController(robot, TASK_SETTINGS)
        self._task = PickAndPlace(_goal(do, world), gripping, home, time_limit=_LONGEST[do.task])

    @property
    def phase(self) -> Phase:
        """What is being done."""
        return self._task.phase

    @property
    def verdict(self) -> str:
        """How it ended, in words."""
        failure = self._task.failure
        if self.phase is Phase.DONE:
            return "the task is done"
        return "the task has failed" if failure is None else failure.sentence

    def step(self, state: JointState, plant: LivePlant, sight: Sight | None) -> ControlStep:
        """Return the torque until the next step, and move the fingers.

        Args:
            state: what the joints say.
            plant: the arm, whose gripper is asked and told.
            sight: the latest that the eye knows.
        """
        command = self._task.tick(state, plant.gripper, sight)
        if command.payload != self._payload:
            self._payload = command.payload
            loaded = self._robot.with_payload(command.payload) if command.payload else self._robot
            self._controller = MpcController(loaded, TASK_SETTINGS)
        plant.grip(command.opening)
        target = command.target
        self.target = target.q[-1] if isinstance(target, JointTrajectory) else np.asarray(target)
        return self._controller.step(state, target)


def _goal(do: cmd.Do, world: World) -> Goal:
    if do.task == "grasp":
        return Grasping(do.target, do.place, _BELIEVED_MASS)
    if not world.bins:
        raise InputError("there are no bins to sort into; put some into the world")
    trays = [Tray(it.name, it.x, it.y, it.half_size, it.wall_m) for it in world.bins]
    return Sorting(trays, _BELIEVED_MASS)

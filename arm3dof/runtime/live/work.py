"""Tasks in the live world: grasp a thing, or sort all, step by step as a mind decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from arm3dof.control.mpc import MpcController
from arm3dof.control.reference import JointTrajectory, Target
from arm3dof.control.step import ControlStep
from arm3dof.errors import ArmError, InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.mind import Decision, Errand, Hand, Mind, Moment
from arm3dof.runtime.live.plants import LivePlant
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.runtime.tasks.goals import Goal, Grasping, Sorting, Tray
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.run import TASK_SETTINGS
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World
from arm3dof.state import Array, JointState

PHASES = tuple(Phase)
PATIENCE = 30.0
"""How long a decision or a picture may take [s]. They take 0.3 and 0.04 s, but what decides may
just be starting, and all of it on a machine that has other things to do."""
_BELIEVED_MASS = 0.02  # of a thing [kg]
_LONGEST = {"grasp": 60.0, "sort": 240.0}  # [s]


class Work:
    """A task that the arm is carrying out.

    The task has a clock of its own. It stands still while a way is planned for longer than a
    control step, so that the way still begins now when it comes; and while a picture
    is awaited, so that a slow camera makes the task wait and not give up.

    Attributes:
        phase: what is being done.
        controller: what moves the arm.
        payload: what the arm is believed to hold [kg].
    """

    def __init__(self, errand: Errand, robot: Robot, mind: Mind) -> None:
        """Begin.

        Args:
            errand: what is to be done.
            robot: the arm as its controller knows it.
            mind: what decides.

        Raises:
            ArmError: nobody is there to decide.
        """
        self.phase, self.payload = Phase.LOOK, 0.0
        self.controller = MpcController(robot, TASK_SETTINGS)
        self._robot, self._mind = robot, mind
        self._way: Target = errand.home
        self._why = ""
        self._asked: float | None = None
        self._behind = 0.0  # the task's clock, behind the arm's [s]
        self._looks_since: float | None = None
        mind.begin(errand)

    @property
    def dt(self) -> float:
        """Time between two control steps [s]."""
        return TASK_SETTINGS.dt

    @property
    def target(self) -> Array:
        """Where the joints are to be in the end, shape (nv,) [rad]."""
        way = self._way
        return way.q[-1] if isinstance(way, JointTrajectory) else np.asarray(way, float)

    @property
    def verdict(self) -> str:
        """How it ended, in words."""
        if self.phase is Phase.DONE:
            return "the task is done"
        return self._why or "the task has failed"

    def step(self, state: JointState, plant: LivePlant, sight: Sight | None) -> ControlStep:
        """Return the torque until the next step, and move the fingers.

        Args:
            state: what the joints say.
            plant: the arm, whose gripper is asked and told.
            sight: the latest that the eye knows.
        """
        try:
            self._take(state, plant)
            if self._asked is None and not self.phase.is_final:
                self._ask(state, plant, sight)
        except ArmError as error:
            self._fail(str(error))
        return self.controller.step(state, self._way)

    def _ask(self, state: JointState, plant: LivePlant, sight: Sight | None) -> None:
        """Ask for the next decision; where pictures decide, only with a new one."""
        new = None
        now = JointState(state.t - self._behind, state.q, state.v)
        if self.phase is Phase.LOOK:
            if self._looks_since is None:
                self._looks_since = state.t
            elif sight is None or sight.taken_at <= self._looks_since:
                self._behind += self.dt
                if state.t - self._looks_since > PATIENCE:
                    self._fail(f"no picture came within {PATIENCE:g} s")
                return
            else:
                self._looks_since, new = sight.taken_at, replace(sight, taken_at=now.t)
        hand = Hand(plant.gripper.opening, plant.gripper.moving)
        self._asked = state.t
        self._mind.tell(Moment(now, hand, new))
        self._take(state, plant)

    def _take(self, state: JointState, plant: LivePlant) -> None:
        """Do what was decided, if that has come."""
        if self._asked is None:
            return
        took = state.t - self._asked
        decision = self._mind.decided()
        if decision is None:
            if took > PATIENCE:
                self._fail(f"no decision came within {PATIENCE:g} s")
            return
        self._asked = None
        if decision.target is not None:  # a way that was planned, and begins now
            self._behind += max(took - self.dt, 0.0)
        self._follow(decision, plant)

    def _follow(self, decision: Decision, plant: LivePlant) -> None:
        if self.phase is not Phase.LOOK:
            self._looks_since = None  # the next look begins when it begins
        self.phase, self._why = decision.phase, decision.why
        if decision.payload != self.payload:
            self.payload = decision.payload
            held = self._robot.with_payload(self.payload) if self.payload else self._robot
            self.controller = MpcController(held, TASK_SETTINGS)
        if decision.opening is not None:
            plant.grip(decision.opening)
        way = decision.target
        if isinstance(way, JointTrajectory):
            self._way = JointTrajectory(way.times + self._behind, way.q) if self._behind else way
        elif way is not None:
            self._way = way

    def _fail(self, why: str) -> None:
        self.phase, self._why, self._asked = Phase.FAILED, why, None


def errand(do: cmd.Do, robot: Robot, home: Array, world: World) -> Errand:
    """Return what a mind has to know of a task.

    Args:
        do: what is to be done.
        robot: the arm as its controller knows it.
        home: where the arm waits while the camera looks, shape (nv,) [rad].
        world: what is known of the surroundings: the table and the bins.

    Raises:
        InputError: the world lacks what the task needs.
    """
    return Errand(
        _goal(do, world), PackedRobot.of(robot), home, world.table.height, _LONGEST[do.task]
    )


def _goal(do: cmd.Do, world: World) -> Goal:
    if do.task == "grasp":
        return Grasping(do.target, do.place, _BELIEVED_MASS)
    if not world.bins:
        raise InputError("there are no bins to sort into; put some into the world")
    trays = [Tray(it.name, it.x, it.y, it.half_size, it.wall_m) for it in world.bins]
    return Sorting(trays, _BELIEVED_MASS)

"""A task and a plant joined: the controller at its rate, the camera at its own, all on record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStep
from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.machine import Phase, Refusal, Step
from arm3dof.runtime.tasks.pick_and_place import PickAndPlace
from arm3dof.runtime.tasks.signals import Gripper, Sight
from arm3dof.sim.plant import Plant
from arm3dof.state import JointState

TASK_SETTINGS = MpcSettings(dt=0.02, horizon=20, input_weight=1e-6)
"""The controller of tasks: stiffer than the default, as it follows smooth trajectories, and what
friction and backlash leave is a millimetre at the tool instead of three."""


class GrippingPlant(Plant, Protocol):
    """A plant whose arm has a gripper."""

    @property
    def gripper(self) -> Gripper:
        """What the gripper says of itself."""

    def command_gripper(self, opening_m: float) -> None:
        """Ask the gripper for an opening [m]."""


class TaskEye(Protocol):
    """What tells a task which things stand where."""

    def sight(self, t: float, looking: bool) -> Sight | None:
        """Return the latest that is known."""


REST = 0.5
"""How long the arm is held at the end of a task [s]."""
Watcher = Callable[[JointState, ControlStep, Phase], None]
"""Called after each control step with the measured state, the answer and the phase."""


@dataclass(frozen=True)
class TaskResult:
    """How a task went.

    Attributes:
        phase: the phase that it ended in.
        steps: every transition.
        failure: why it, or its last thing, failed; None when nothing did.
        duration: how long it took [s].
    """

    phase: Phase
    steps: tuple[Step, ...]
    failure: Refusal | None
    duration: float

    @property
    def done(self) -> bool:
        """Whether the task says of itself that it is done."""
        return self.phase is Phase.DONE


def run_task(
    task: PickAndPlace,
    plant: GrippingPlant,
    eye: TaskEye,
    robot: Robot,
    *,
    settings: MpcSettings = TASK_SETTINGS,
    watch: Callable[[JointState, ControlStep, Phase], None] | None = None,
) -> TaskResult:
    """Run a task to its end, which its own limit of time brings if nothing else does.

    The task is told what the joints and the gripper measure and what the eye sees, nothing else.
    Between two control steps the torque is held, and at the end the arm. When the payload
    changes, a controller that knows it takes over.

    Args:
        task: the task.
        plant: the arm, its gripper and its world.
        eye: what sees.
        robot: the robot as the controller knows it.
        settings: of the controller.
        watch: called after each control step.
    """
    hold = max(round(settings.dt / plant.dt), 1)
    start = plant.state.t
    controller, payload = MpcController(robot, settings), 0.0
    over: float | None = None
    while over is None or plant.state.t < over + REST - 1e-9:
        if over is None and task.phase.is_final:
            over = plant.state.t
        measured = plant.measure()
        sight = eye.sight(measured.t, task.phase is Phase.LOOK)
        command = task.tick(measured, plant.gripper, sight)
        if command.payload != payload:
            payload = command.payload
            loaded = robot.with_payload(payload) if payload > 0 else robot
            controller = MpcController(loaded, settings)
        answer = controller.step(measured, command.target)
        if watch is not None:
            watch(measured, answer, task.phase)
        plant.command_gripper(command.opening)
        for remaining in reversed(range(hold)):
            plant.step(answer.tau)
            if remaining:  # the last reading is the next step's measurement
                controller.observe(plant.measure())
    return TaskResult(task.phase, tuple(task.steps), task.failure, over - start)

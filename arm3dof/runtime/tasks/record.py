"""A task as a recording: the arm, the gripper and every body, once a control step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from arm3dof.control.step import ControlStep
from arm3dof.errors import InputError
from arm3dof.runtime.experiment import settings_notes
from arm3dof.runtime.recording import Recording
from arm3dof.runtime.tasks.machine import Phase, Step
from arm3dof.runtime.tasks.run import TASK_SETTINGS, TaskResult
from arm3dof.runtime.tasks.simulated import SimulatedTask
from arm3dof.state import Array, JointState


class TaskRecorder:
    """Records a simulated task; give it to ``SimulatedTask.run`` as ``watch``.

    The rows are the control steps, and hold the true states. The error is that from the
    trajectory which the arm follows then.
    """

    def __init__(self, scene: SimulatedTask) -> None:
        """Begin with nothing.

        Args:
            scene: what is recorded.
        """
        self._scene = scene
        self._states: list[JointState] = []
        self._answers: list[ControlStep] = []
        self._openings: list[float] = []
        self._bodies: dict[str, list[Array]] = {it.name: [] for it in scene.plant.world.bodies}

    def __call__(self, state: JointState, answer: ControlStep, phase: Phase) -> None:
        """Record one control step."""
        plant = self._scene.plant
        self._states.append(plant.state)
        self._answers.append(answer)
        self._openings.append(plant.gripper.opening)
        for name, rows in self._bodies.items():
            rows.append(pin.SE3ToXYZQUAT(pin.SE3(plant.body_pose(name))))

    def recording(
        self, result: TaskResult | None = None, notes: Mapping[str, str] | None = None
    ) -> Recording:
        """Return what was recorded.

        Args:
            result: how the task went; its transitions are kept as notes, ``task.01 look`` ...
            notes: further text to keep.

        Raises:
            InputError: nothing was recorded.
        """
        if not self._states:
            raise InputError("nothing was recorded; run a task first")
        robot, answers, nv = self._scene.robot, self._answers, self._scene.robot.nv
        q = np.array([state.q for state in self._states])
        e = np.array([answer.plan[0, :nv] for answer in answers])
        kept = settings_notes(TASK_SETTINGS) | ({} if result is None else _steps_notes(result))
        return Recording(
            t=np.array([state.t for state in self._states]),
            q=q,
            v=np.array([state.v for state in self._states]),
            tau=np.array([answer.tau for answer in answers]),
            u=np.array([answer.u for answer in answers]),
            e=e,
            status=np.array([answer.status for answer in answers]),
            source=np.array([answer.source for answer in answers]),
            step_time=np.array([answer.solve_time for answer in answers]),
            control_dt=TASK_SETTINGS.dt,
            q_target=q[-1] + e[-1],
            joint_names=robot.joint_names,
            tool_frame=robot.tool_frame,
            limits=robot.limits,
            robot=robot.description,
            notes=dict(notes or {}) | kept,
            gripper=np.array(self._openings),
            world=self._scene.plant.world,
            bodies={name: np.array(rows) for name, rows in self._bodies.items()},
        )


def steps_report(steps: tuple[Step, ...]) -> list[dict[str, object]]:
    """Return transitions as names and values."""
    return [
        {"t_s": step.t, "from": step.source, "to": step.target, "reason": step.reason}
        for step in steps
    ]


def _steps_notes(result: TaskResult) -> dict[str, str]:
    return {
        f"task.{number:02d} {step.source}": f"until {step.t:.2f} s: {step.reason}"
        for number, step in enumerate(result.steps, start=1)
    }

"""The loop that joins a controller to a plant and records both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from arm3dof.control.reference import Target, sample_target
from arm3dof.control.step import Controller, ControlStep, ReadsBetweenSteps
from arm3dof.errors import InputError
from arm3dof.runtime.recording import Recording
from arm3dof.sim.plant import Plant
from arm3dof.state import JointState

Observer = Callable[[JointState, ControlStep], None]
"""Called after each control step with the measured state and the controller's answer."""


def run_loop(
    plant: Plant,
    controller: Controller,
    target: Target,
    duration: float,
    observers: Sequence[Observer] = (),
    *,
    notes: Mapping[str, str] | None = None,
) -> Recording:
    """Drive a plant from its present state towards a target and record every plant step.

    The controller is told what the plant measures, also between its steps if it makes use of that
    (``ReadsBetweenSteps``). The recording holds the true states, and the
    torques that the motors truly gave; behind a delay they are the controller's of some time ago.

    Args:
        plant: the arm; its state is the start.
        controller: asked every ``controller.dt``; its torque is held in between.
        target: constant joint target, shape (nv,) [rad], or a trajectory in plant time.
        duration: how long to run [s].
        observers: called after each control step.
        notes: text to keep in the recording.

    Raises:
        InputError: the target has another shape, the duration is not positive, or the
            controller's period is not a whole number of plant steps.
    """
    robot = plant.robot
    nv = robot.nv
    hold = _plant_steps_per_control_step(plant.dt, controller.dt)
    if not (np.isfinite(duration) and duration >= plant.dt):
        raise InputError(f"duration is {duration!r} s; give at least one plant step, {plant.dt} s")
    rows = round(duration / plant.dt)
    followed = sample_target(target, nv, plant.state.t, plant.dt, rows - 1).q

    t, step_time = np.empty(rows), np.full(rows, np.nan)
    q, v, tau, u = (np.empty((rows, nv)) for _ in range(4))
    status, source = np.empty(rows, np.int8), np.empty(rows, np.int8)
    reader = controller if isinstance(controller, ReadsBetweenSteps) else None
    state = plant.state
    for row in range(rows):
        if row % hold == 0:
            measured = plant.measure()
            answer = controller.step(measured, target)
            step_time[row] = answer.solve_time
            for observe in observers:
                observe(measured, answer)
        elif reader is not None:
            reader.observe(plant.measure())
        t[row], q[row], v[row] = state.t, state.q, state.v
        u[row], status[row], source[row] = answer.u, answer.status, answer.source
        state = plant.step(answer.tau)
        tau[row] = plant.applied_torque
    return Recording(
        t=t,
        q=q,
        v=v,
        tau=tau,
        u=u,
        e=followed - q,
        status=status,
        source=source,
        step_time=step_time,
        control_dt=controller.dt,
        q_target=followed[-1],
        joint_names=robot.joint_names,
        tool_frame=robot.tool_frame,
        limits=robot.limits,
        robot=robot.description,
        notes=dict(notes or {}),
    )


def _plant_steps_per_control_step(plant_dt: float, control_dt: float) -> int:
    ratio = control_dt / plant_dt
    hold = round(ratio)
    if hold < 1 or abs(ratio - hold) > 1e-6 * ratio:
        raise InputError(
            f"the controller's period {control_dt} s is not a whole number of plant steps of "
            f"{plant_dt} s; choose a plant dt that divides it"
        )
    return hold

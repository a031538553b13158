"""Recordings for the tests of what people see: made in no time, with real dynamics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording

TARGET = np.deg2rad([28.1, 67.8, 53.8])
CONTROL_ROWS = 25


def smooth_run(
    robot: Robot,
    *,
    start: ArrayLike | None = None,
    target: ArrayLike | None = None,
    duration: float = 3.0,
    dt: float = 0.002,
    stiffness: float = 6.0,
) -> Recording:
    """A run in which each joint goes to its target like a critically damped spring.

    Args:
        robot: the robot.
        start: first position, shape (nv,) [rad]; zero when ``None``.
        target: last position, shape (nv,) [rad]; the paper's when ``None``.
        duration: [s].
        dt: between rows [s].
        stiffness: natural frequency of the springs [rad/s]; a low one does not settle.
    """
    q_start = np.zeros(robot.nv) if start is None else np.asarray(start, float)
    q_target = TARGET if target is None else np.asarray(target, float)
    t = np.arange(max(1, round(duration / dt))) * dt
    w = stiffness * (1 + 0.1 * np.arange(robot.nv))
    wt = w * t[:, None]
    decay, gap = np.exp(-wt), q_target - q_start
    q = q_target - gap * decay * (1 + wt)
    v, u = gap * w * wt * decay, gap * w**2 * decay * (1 - wt)
    tau = np.array([robot.inverse_dynamics(*row) for row in zip(q, v, u, strict=True)])
    step_time = np.full(t.size, np.nan)
    step_time[::CONTROL_ROWS] = 2e-4
    return Recording(
        t=t,
        q=q,
        v=v,
        tau=tau,
        u=u,
        e=q_target - q,
        status=np.full(t.size, ControlStatus.SOLVED),
        source=np.full(t.size, TorqueSource.OPTIMUM),
        step_time=step_time,
        control_dt=CONTROL_ROWS * dt,
        q_target=q_target,
        joint_names=robot.joint_names,
        tool_frame=robot.tool_frame,
        limits=robot.limits,
        robot=robot.description,
        notes={},
    )

"""Recordings for the tests of what people see: made in no time, with real dynamics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.sim.world import Bin, Body, World

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


def carried_run(robot: Robot, duration: float = 1.0) -> Recording:
    """A run in which the gripper closes while a cylinder rises by 0.1 m, past a cube and a bin."""
    made = smooth_run(robot, duration=duration)
    share = (made.t / made.t[-1])[:, None]
    table = World().table.height
    foot = np.array([0.16, -0.04, table + 0.0225])
    cylinder = np.hstack([foot + share * (0, 0, 0.1), np.tile([0, 0, 0, 1.0], (len(made), 1))])
    cube = np.tile([0.1, 0.12, table + 0.015, 0, 0, 0, 1.0], (len(made), 1))
    world = World(
        bodies=(
            Body("cylinder", "cylinder", 0.03, 0.045, 0.02, (0.1, 0.6, 0.2), *foot[:2].tolist()),
            Body("cube", "cube", 0.03, 0.03, 0.02, (0.8, 0.1, 0.1), 0.1, 0.12),
        ),
        bins=(Bin("green", 0.05, -0.16, (0.04, 0.03), (0.1, 0.6, 0.2)),),
    )
    bodies = {"cylinder": cylinder, "cube": cube}
    return replace(made, gripper=0.05 - 0.02 * share[:, 0], world=world, bodies=bodies)

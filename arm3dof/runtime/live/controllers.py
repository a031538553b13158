"""The controllers that a person can choose from."""

from __future__ import annotations

from arm3dof.control import baselines
from arm3dof.control.mpc import MpcController
from arm3dof.control.step import Controller
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd


def build_controller(robot: Robot, control: cmd.Control) -> Controller:
    """Return the chosen controller.

    Args:
        robot: the arm as the controller is to know it.
        control: the choice.
    """
    settings = control.settings()
    match control.controller:
        case "mpc":
            return MpcController(robot, settings)
        case "computed-torque":
            return baselines.computed_torque(robot, settings.dt)
        case "pd-gravity":
            return baselines.pd_gravity(robot, settings.dt, control.gains)
        case "pid":
            return baselines.pid(robot, settings.dt, control.gains)
        case "pd":
            return baselines.pd(robot, settings.dt, control.gains)

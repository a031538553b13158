"""One simulated motion under MPC: the paper's experiment, for any robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.runtime.loop import Observer, run_loop
from arm3dof.runtime.recording import Recording
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.plant import Plant
from arm3dof.state import Array, JointState

PAPER_TARGET_DEG = (28.1, 67.8, 53.8)
"""The joint angles that the paper's arm is driven to from (0, 0, 0), section VI [deg]."""
PAPER_DURATION = 6.0
"""The time in which the paper's arm comes to rest [s]."""
_PLANT_DT = (
    0.001  # [s]: the plant's step is this or a little less, so that it divides the control step
)
_DEFAULT_MOVE = np.deg2rad(30.0)

PlantFactory = Callable[[Robot, float], Plant]
"""Makes the plant that stands in for a robot, from the robot and the time of a step [s]."""


def simulate(
    robot: Robot,
    start: ArrayLike,
    target: ArrayLike,
    *,
    settings: MpcSettings | None = None,
    duration: float = PAPER_DURATION,
    observers: Sequence[Observer] = (),
    notes: Mapping[str, str] | None = None,
    make_plant: PlantFactory = PinocchioPlant,
) -> Recording:
    """Drive a robot from rest at one configuration to another, in simulation.

    Args:
        robot: the robot; controller and plant each take a copy of it.
        start: joint positions at rest, shape (nv,) [rad].
        target: joint positions to reach, shape (nv,) [rad].
        settings: the controller's settings.
        duration: how long to simulate [s].
        observers: called after each control step.
        notes: text to keep in the recording, beside the controller's settings.
        make_plant: makes the plant, for instance a ``DisturbedPlant`` around another robot.

    Raises:
        InputError: an argument has another shape or a value outside its domain.
    """
    settings = settings or MpcSettings()
    controller = MpcController(robot, settings)
    plant = make_plant(robot, controller.dt / np.ceil(controller.dt / _PLANT_DT - 1e-9))
    plant.reset(JointState(0.0, np.asarray(start, float), np.zeros(robot.nv)))
    kept = settings_notes(settings) | dict(notes or {})
    return run_loop(plant, controller, target, duration, observers, notes=kept)


def settings_notes(settings: MpcSettings) -> dict[str, str]:
    """Return a controller's settings as notes of a recording, ``mpc.horizon`` and so on."""
    given = {item.name: getattr(settings, item.name) for item in fields(settings)}
    return {f"mpc.{name}": str(value) for name, value in given.items() if value is not None}


def default_start(robot: Robot) -> Array:
    """Return zero for every joint that may be there, else the middle of its range [rad]."""
    low, high = robot.limits.q_min, robot.limits.q_max
    inside = (low <= 0.0) & (high >= 0.0)
    return np.where(inside, 0.0, (np.where(inside, 0.0, low) + np.where(inside, 0.0, high)) / 2)


def default_target(robot: Robot, start: ArrayLike) -> Array:
    """Return the paper's target for an arm of three joints, else 30 degrees a joint from the start.

    Args:
        robot: the robot.
        start: joint positions, shape (nv,) [rad].

    Returns:
        Joint positions inside the limits, shape (nv,) [rad]; each joint turns to its roomier side.
    """
    low, high, start = robot.limits.q_min, robot.limits.q_max, np.asarray(start, float)
    paper = np.deg2rad(PAPER_TARGET_DEG)
    if robot.nv == paper.size and (low <= paper).all() and (paper <= high).all():
        return paper
    side = np.where(high - start >= start - low, 1.0, -1.0)
    return np.asarray(np.clip(start + side * _DEFAULT_MOVE, low, high))

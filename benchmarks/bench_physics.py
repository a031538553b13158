"""How fast the physics world runs, and what a picture of it costs."""

from __future__ import annotations

from itertools import product
from time import process_time

import numpy as np

from arm3dof.control.mpc import MpcController
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.scatter import scatter
from arm3dof.sim.world import COLOURS, Body, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.state import Array, JointState
from benchmarks.tables import Table

_CHUNK = 200  # plant steps that are timed together
_CAN = Body("can", "cylinder", 0.03, 0.06, 0.04, COLOURS["red"], 0.19, 0.05)
_AWAY = np.array([2.2, 1.6, -0.5])


def run(*, quick: bool) -> list[Table]:
    """Time plant steps with nothing about, with nine objects and with one held; and pictures."""
    return [_steps(quick), _pictures(quick)]


def _steps(quick: bool) -> Table:
    robot = load_robot("arm3dof")
    nine = scatter(np.random.default_rng(4), 9)
    chunks = 5 if quick else 100
    rows = []
    for name, world, dt in (
        ("an empty table", World(), 0.001),
        ("nine objects that stand", World(bodies=nine), 0.001),
        ("an object that is held and swung", World(bodies=(_CAN,)), 0.001),
        ("the same, steps of 2 ms", World(bodies=(_CAN,)), 0.002),
    ):
        plant = MujocoPlant(robot, world, dt=dt)
        plant.reset(JointState(0.0, _AWAY, np.zeros(3)))
        if _CAN in world.bodies:
            _grip(robot, plant)
        times = np.array([_swing(plant, robot, chunk) for chunk in range(chunks)]) / _CHUNK
        median, best = float(np.median(times)), float(times.min())
        rows.append((name, f"{1e6 * median:.0f}", f"{1e6 * best:.0f}", f"{dt / median:.0f}"))
    return Table(
        "Physics",
        ("world", "median [us]", "best [us]", "times real time"),
        rows,
        f"A plant step, from torque to state: processor time of {chunks} runs of {_CHUNK} steps. "
        "Controllers and pictures come on top.",
    )


def _grip(robot: Robot, plant: MujocoPlant) -> None:
    low = inverse_kinematics(robot, [_CAN.x, _CAN.y, -0.08]).best
    high = inverse_kinematics(robot, [_CAN.x, _CAN.y, -0.01], near=low).best
    plant.reset(JointState(0.0, low, np.zeros(3)))
    plant.command_gripper(0.0)
    controller = MpcController(robot)
    for target, duration in ((low, 0.7), (high, 1.0)):
        for step in range(round(duration / plant.dt)):
            if step % round(controller.dt / plant.dt) == 0:
                tau = controller.step(plant.measure(), target).tau
            plant.step(tau)
    if plant.body_pose("can")[2, 3] < -0.05:
        raise RuntimeError("the object was not lifted")


def _swing(plant: MujocoPlant, robot: Robot, chunk: int) -> float:
    """Return the time of some steps that swing the base to and fro [s]."""
    tau = robot.gravity(plant.state.q) + np.array([0.05 * (-1) ** (chunk // 2), 0.0, 0.0])
    start = process_time()
    for _ in range(_CHUNK):
        state = plant.step(tau)
    spent = process_time() - start
    if plant.world.bodies == (_CAN,) and not np.isfinite(state.q).all():
        raise RuntimeError("the arm is lost")
    return spent


def _pictures(quick: bool) -> Table:
    plant = MujocoPlant(load_robot("arm3dof"), World(bodies=scatter(np.random.default_rng(4), 9)))
    plant.reset(JointState(0.0, np.array([0.2, 1.3, -1.2]), np.zeros(3)))
    matrix = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
    repetitions = 5 if quick else 50
    rows = []
    for smooth, shadows in product((False, True), repeat=2):
        with WorldCamera(
            plant, matrix, _pose(), 640, 480, smooth=smooth, shadows=shadows
        ) as camera:
            camera.take()
            times = []
            for _ in range(repetitions):
                start = process_time()
                camera.take()
                times.append(process_time() - start)
        looks = [name for name, on in (("smooth edges", smooth), ("shadows", shadows)) if on]
        name = " and ".join(looks) or "neither"
        rows.append((name, f"{1e3 * np.median(times):.0f}", f"{1e3 * min(times):.0f}"))
    return Table(
        "Pictures of the physics world",
        ("drawn with", "median [ms]", "best [ms]"),
        rows,
        f"640 x 480, the arm and nine objects: processor time, which Mesa spreads over the cores, "
        f"of {repetitions} pictures each.",
    )


def _pose() -> Array:
    """Return a camera's pose from the front and above, looking at the arm."""
    eye, aim = np.array([0.62, -0.25, 0.32]), np.array([0.12, 0.0, -0.07])
    forward = (aim - eye) / np.linalg.norm(aim - eye)
    right = np.array([forward[1], -forward[0], 0.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = eye
    return pose

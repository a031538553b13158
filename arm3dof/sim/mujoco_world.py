"""A whole world as a MuJoCo model: arm, gripper's servo, table, bodies, bins and light."""

from __future__ import annotations

import math

from arm3dof.model.gripper import Gripper
from arm3dof.model.robot import Robot
from arm3dof.sim.engine import mujoco
from arm3dof.sim.mujoco_arm import FIRM, HARD, LOOSE, ROBOT, SEEN, STATIC, VISIBLE, add_arm
from arm3dof.sim.mujoco_looks import MATTE, add_looks
from arm3dof.sim.world import WALL, Bin, Body, World

GRIPPER = "gripper servo"
_GRIPPER_STIFFNESS = 4000.0  # N/m at the driven finger: 5 mm off is full force
_GRIPPER_DAMPING = 14.0  # N s/m: with the guides' it keeps the fingers from overshooting


def build_model(
    robot: Robot, gripper: Gripper | None, world: World, timestep: float
) -> mujoco.MjModel:
    """Compile a robot and its world.

    Args:
        robot: the robot, its fingers free where it has a gripper.
        gripper: the gripper; None where the robot has none.
        world: what stands around it.
        timestep: of the integration [s].
    """
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.option.timestep = timestep
    spec.option.gravity = robot.gravity_acceleration
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0  # stiff friction: what is held creeps by 0.05 mm in 10 s
    spec.option.iterations = 30
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # it would hide a breakdown
    spec.compiler.degree, spec.compiler.autolimits = False, False
    add_arm(spec, robot, gripper, world.grip_friction)
    for name, limit in zip(robot.joint_names, robot.limits.tau_max, strict=True):
        if gripper is None or name not in gripper.joints:
            motor = spec.add_actuator(name=name, target=name)
            motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
            motor.set_to_motor()
            motor.forcelimited, motor.forcerange = True, (-limit, limit)
    if gripper is not None:
        _add_gripper(spec, gripper, robot)
    add_looks(spec, world)
    _add_table(spec, world)
    for tray in world.bins:
        _add_bin(spec, tray, world)
    for body in world.bodies:
        _add_body(spec, body, world)
    return spec.compile()


def _add_gripper(spec: mujoco.MjSpec, gripper: Gripper, robot: Robot) -> None:
    """Add the gripper's position servo, and what keeps its fingers together."""
    servo = spec.add_actuator(name=GRIPPER, target=gripper.driven.joint)
    servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
    servo.set_to_position(kp=_GRIPPER_STIFFNESS, kv=_GRIPPER_DAMPING)
    servo.forcelimited, servo.forcerange = True, (-gripper.effort, gripper.effort)
    follow = spec.add_equality(
        name="fingers",
        type=mujoco.mjtEq.mjEQ_JOINT,
        name1=gripper.follower.joint,
        name2=gripper.driven.joint,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
    )
    follow.data[:5] = (gripper.follower.offset, gripper.follower.multiplier, 0.0, 0.0, 0.0)
    follow.solref, follow.solimp = FIRM, (0.99, 0.999, 0.001, 0.5, 2.0)


# ---- what stands around ------------------------------------------------------------------------


def _add_table(spec: mujoco.MjSpec, world: World) -> None:
    table = world.table
    ground = spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=(*table.centre, table.height),
        size=(*table.half_size, 0.05),
        material=world.surface,
    )
    _still(ground, world)


def _still(geom: mujoco.MjsGeom, world: World) -> None:
    geom.contype, geom.conaffinity, geom.group = STATIC, 0, VISIBLE
    geom.friction = (world.friction, 0.002, 0.0001)
    geom.condim = 4


def _add_bin(spec: mujoco.MjSpec, tray: Bin, world: World) -> None:
    x, y = tray.half_size
    at = (tray.x, tray.y, world.table.height)
    base = spec.worldbody.add_body(name=f"bin {tray.name}", pos=at)
    rgba = (*tray.colour, 1.0)
    floor = base.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, pos=(0, 0, 0.0004), size=(x, y, 0.0004), rgba=rgba
    )
    floor.contype, floor.conaffinity, floor.group = SEEN, SEEN, VISIBLE
    high = tray.wall_m / 2
    for sign in (-1.0, 1.0):
        for pos, size in (
            ((sign * (x + WALL / 2), 0.0, high), (WALL / 2, y + WALL, high)),
            ((0.0, sign * (y + WALL / 2), high), (x, WALL / 2, high)),
        ):
            wall = base.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size, rgba=rgba)
            _still(wall, world)


def _add_body(spec: mujoco.MjSpec, body: Body, world: World) -> None:
    """Add an object with the inertia of an even solid, standing on the table."""
    half = body.height_m / 2
    item = spec.worldbody.add_body(
        name=body.name,
        pos=(body.x, body.y, world.table.height + half),
        quat=(math.cos(body.yaw / 2), 0.0, 0.0, math.sin(body.yaw / 2)),
    )
    item.add_freejoint(name=body.name)
    radius = body.width_m / 2
    if body.shape == "cube":
        parts = [(mujoco.mjtGeom.mjGEOM_BOX, 0.0, (radius, radius, half), body.mass)]
    elif body.shape == "cylinder":
        parts = [(mujoco.mjtGeom.mjGEOM_CYLINDER, 0.0, (radius, half, 0.0), body.mass)]
    else:
        parts = _bottle(body)
    for kind, z, size, mass in parts:
        geom = item.add_geom(
            type=kind, pos=(0.0, 0.0, z), size=size, mass=mass, rgba=(*body.colour, 1.0)
        )
        geom.contype, geom.conaffinity = LOOSE, LOOSE | STATIC | ROBOT
        geom.group, geom.material = VISIBLE, MATTE
        geom.condim = 4
        geom.friction = (world.friction, 0.002, 0.0001)
        geom.solref, geom.solimp = FIRM, HARD


def _bottle(body: Body) -> list[tuple[int, float, tuple[float, float, float], float]]:
    """Return a bottle's belly, and a neck of 0.4 of its width on the upper 0.3 of its height."""
    radius, height = body.width_m / 2, body.height_m
    belly, neck = 0.7 * height, 0.3 * height
    share = 0.4**2 * neck / (belly + 0.4**2 * neck)
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER
    return [
        (kind, (belly - height) / 2, (radius, belly / 2, 0.0), (1 - share) * body.mass),
        (kind, (height - neck) / 2, (0.4 * radius, neck / 2, 0.0), share * body.mass),
    ]

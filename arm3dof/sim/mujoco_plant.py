"""The arm and its world as MuJoCo simulates them: contact, friction, a gripper that grips."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import ArmError, InputError
from arm3dof.model.gripper import Gripper, find_gripper, with_free_gripper
from arm3dof.model.robot import Robot
from arm3dof.sim.engine import mujoco
from arm3dof.sim.mujoco_arm import set_inertias
from arm3dof.sim.mujoco_world import GRIPPER, build_model
from arm3dof.sim.plant import check_start
from arm3dof.sim.servo import Servo, holding_torque
from arm3dof.sim.world import World
from arm3dof.state import Array, JointState, finite_vector

_LONGEST = 0.002  # the longest step of the integrator [s]; what is longer is divided


@dataclass(frozen=True)
class GripperState:
    """What the gripper's servo knows of itself.

    Attributes:
        opening: distance of the pads [m].
        effort: the servo's force on the fingers, half of which each presses with; positive when
            it closes [N].
        command: the opening that was asked for [m].
        moving: whether the servo is still on its way to the command.
    """

    opening: float
    effort: float
    command: float
    moving: bool


class MujocoPlant:
    """A robot on a table, among objects, with its gripper free to move.

    The robot's masses, inertias, damping and friction are those of its URDF (and of its payload);
    torques are held to its limits, and joints stop at theirs. The fingers that the robot's model
    holds still move here, driven by a position servo of limited force and speed. The world's frame
    is the robot's base frame.

    Attributes:
        robot: the robot, as its controller knows it.
        world: what stands around it, as it was at the last ``reset``.
        model: MuJoCo's model; for those who know MuJoCo.
        data: MuJoCo's data.
    """

    def __init__(
        self,
        robot: Robot,
        world: World | None = None,
        *,
        dt: float = 0.001,
        servo: Servo | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Create a plant at the middle of the joint range, at rest, with its gripper open.

        Args:
            robot: the robot to simulate.
            world: what stands around it; an empty table without one.
            dt: time of one step [s]; the integrator takes several where it exceeds 2 ms.
            servo: what stands between a command and the joints, and between the joints and their
                measurement; without one motors and encoders are ideal. The gripper's servo is
                another.
            rng: source of the encoders' noise; needed where there is some.

        Raises:
            InputError: ``dt`` is not positive, the servo has another number of joints, or its
                noise has no source.
        """
        if not (math.isfinite(dt) and dt > 0):
            raise InputError(f"dt is {dt!r}; give a positive number of seconds")
        self.world = World() if world is None else world
        self._dt = float(dt)
        self._drive = None if servo is None else servo.drive(robot, self._dt, rng)
        self._substeps = math.ceil(dt / _LONGEST - 1e-9)
        self.robot = robot.clone()
        self._gripper = find_gripper(robot)
        free = robot if self._gripper is None else with_free_gripper(robot, self._gripper)
        self.model = build_model(free, self._gripper, self.world, dt / self._substeps)
        self.data = mujoco.MjData(self.model)
        self._q_at = np.array([self.model.joint(j).qposadr[0] for j in robot.joint_names])
        self._v_at = np.array([self.model.joint(j).dofadr[0] for j in robot.joint_names])
        self._motors = np.array([self.model.actuator(j).id for j in robot.joint_names])
        if self._drive is not None:
            self.model.dof_frictionloss[self._v_at] += self._drive.friction
            self.model.dof_damping[self._v_at] += self._drive.damping
        low, high = robot.limits.q_min, robot.limits.q_max
        middle = np.where(np.isfinite(low) & np.isfinite(high), low / 2 + high / 2, 0.0)
        self.reset(JointState(0.0, middle, np.zeros(robot.nv)))

    # ---- the Plant protocol ----------------------------------------------------------------

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self._dt

    @property
    def state(self) -> JointState:
        """The present state of the arm's joints."""
        t = self._t0 + self._steps * self._dt
        return JointState.adopt(t, self.data.qpos[self._q_at], self.data.qvel[self._v_at])

    @property
    def applied_torque(self) -> Array:
        """The torque of the last step, shape (nv,) [N m]; zero before the first."""
        return self._applied

    def measure(self) -> JointState:
        """Return the present state as the servos' encoders tell it; without servos, as it is."""
        return self.state if self._drive is None else self._drive.measure(self.state)

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state, everything else as the world says, and return the state.

        The gripper is open.

        Raises:
            InputError: the state is not finite or belongs to another robot.
        """
        check_start(self.robot, state)
        mujoco.mj_resetData(self.model, self.data)
        self._t0, self._steps = state.t, 0
        self.data.qpos[self._q_at], self.data.qvel[self._v_at] = state.q, state.v
        self._applied = finite_vector(np.zeros(self.robot.nv), self.robot.nv, "tau")
        if self._gripper is not None:
            self._set_fingers(self._gripper.q_open)
        if self._drive is not None:
            self._drive.reset(state, holding_torque(self.robot, state.q))
        return self.state

    def step(
        self,
        tau: ArrayLike,
        *,
        external_torque: ArrayLike | None = None,
        tool_wrench: ArrayLike | None = None,
    ) -> JointState:
        """Hold a torque for ``dt`` and return the state after it.

        Args:
            tau: torque of the motors, or what the servos are commanded, shape (nv,) [N m]; it
                acts up to the robot's limits.
            external_torque: torque that the surroundings add at the joints, shape (nv,) [N m].
            tool_wrench: force [N] and torque [N m] on the tool in base axes, shape (6,).

        Raises:
            InputError: a torque or the wrench has another shape or is not finite.
            ArmError: the simulation broke down.
        """
        limit = self.robot.limits.tau_max
        asked = finite_vector(tau, self.robot.nv, "tau")
        if self._drive is not None:
            asked = self._drive.torque(asked, self.data.qvel[self._v_at])
        self._applied = np.minimum(np.maximum(asked, -limit), limit)
        self._applied.flags.writeable = False
        self.data.ctrl[self._motors] = self._applied
        self.data.qfrc_applied[self._v_at] = self._push(external_torque, tool_wrench)
        self._move_gripper()
        mujoco.mj_step(self.model, self.data, self._substeps)
        self._steps += 1
        state = self.state
        if not math.isfinite(float(state.v.sum())):
            raise ArmError(
                f"the physics world broke down at {state.t:.3f} s: q = {state.q}, v = {state.v}; "
                f"try shorter steps than {self._dt} s"
            )
        if self._drive is not None:
            self._drive.measure(state)  # the encoders read every step, asked or not
        return state

    def _push(self, torque: ArrayLike | None, wrench: ArrayLike | None) -> Array | float:
        """Return what the surroundings do to the joints, shape (nv,) [N m]; 0 for nothing."""
        pushed: Array | float = 0.0
        if torque is not None:
            pushed = finite_vector(torque, self.robot.nv, "external_torque")
        if wrench is not None:
            jacobian = self.robot.jacobian(self.data.qpos[self._q_at])
            pushed = pushed + jacobian.T @ finite_vector(wrench, 6, "tool_wrench")
        return pushed

    def displace(self, change: ArrayLike) -> JointState:
        """Move the joints at once, with their velocities as they are, and return the state.

        Args:
            change: what is added to the positions, shape (nv,) [rad].

        Raises:
            InputError: the change has another shape or is not finite.
        """
        self.data.qpos[self._q_at] += finite_vector(change, self.robot.nv, "change")
        return self.state

    def change_robot(self, robot: Robot) -> None:
        """Go on with another robot of the same joints, such as one that took up a payload.

        Time, positions and velocities stay as they are; masses and inertias change.

        Raises:
            InputError: the robot has other joints.
        """
        if robot.joint_names != self.robot.joint_names:
            raise InputError(
                f"{robot.name} has the joints {', '.join(robot.joint_names)}; this plant goes on "
                f"with {', '.join(self.robot.joint_names)}"
            )
        free = robot if self._gripper is None else with_free_gripper(robot, self._gripper)
        set_inertias(self.model, free)
        self.robot = robot.clone()

    # ---- the gripper -----------------------------------------------------------------------

    @property
    def has_gripper(self) -> bool:
        """Whether the robot has a gripper that this plant can move."""
        return self._gripper is not None

    @property
    def gripper(self) -> GripperState:
        """What the gripper's servo knows of itself.

        Raises:
            InputError: the robot has no gripper.
        """
        gripper = self._known_gripper()
        driven, follower = (float(self.data.joint(name).qpos[0]) for name in gripper.joints)
        force = float(self.data.actuator(GRIPPER).force[0])
        closes = math.copysign(1.0, gripper.q_closed - gripper.q_open)
        return GripperState(
            opening=gripper.opening_of(driven, follower),
            effort=closes * force,
            command=gripper.opening_of(self._wanted),
            moving=self._setpoint != self._wanted,
        )

    def command_gripper(self, opening_m: float) -> None:
        """Ask the gripper for a distance of its pads [m]; beyond its range, for the nearest.

        The servo moves there at its own speed. What lies between the pads stops them, and is
        pressed with up to the servo's force.

        Raises:
            InputError: the robot has no gripper, or the opening is not finite.
        """
        if not math.isfinite(opening_m):
            raise InputError(f"the gripper's opening is {opening_m}; give metres")
        self._wanted = self._known_gripper().position_of(opening_m)

    def _known_gripper(self) -> Gripper:
        if self._gripper is None:
            raise InputError(f"{self.robot.name} has no gripper of two sliding fingers")
        return self._gripper

    def _set_fingers(self, driven: float) -> None:
        gripper = self._known_gripper()
        follow = gripper.follower
        self.data.joint(gripper.driven.joint).qpos[0] = driven
        self.data.joint(follow.joint).qpos[0] = follow.multiplier * driven + follow.offset
        self._wanted = self._setpoint = driven
        self.data.ctrl[self.model.actuator(GRIPPER).id] = driven

    def _move_gripper(self) -> None:
        """Move the servo's set-point towards what is wanted, as fast as the servo can."""
        if self._gripper is None or self._setpoint == self._wanted:
            return
        most = self._gripper.speed * self._dt
        self._setpoint += min(max(self._wanted - self._setpoint, -most), most)
        self.data.ctrl[self.model.actuator(GRIPPER).id] = self._setpoint

    # ---- the objects -----------------------------------------------------------------------

    def body_pose(self, name: str) -> Array:
        """Return the pose of a body's middle in the base frame, shape (4, 4).

        It is for judging and drawing: no camera or controller may know it.

        Raises:
            InputError: there is no such body.
        """
        self.world.body(name)
        at = self.model.joint(name).qposadr[0]
        pose = np.eye(4)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, self.data.qpos[at + 3 : at + 7])
        pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), self.data.qpos[at : at + 3]
        return pose

"""The live world with contact: an arm with fingers, among things, as MuJoCo simulates it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.model.gripper import find_gripper
from arm3dof.model.robot import Robot
from arm3dof.runtime.live.eye import Watch
from arm3dof.runtime.live.frames import Frames, Ring
from arm3dof.runtime.live.plants import PLANT_DT
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.sim.mujoco_plant import GripperState, MujocoPlant
from arm3dof.sim.plant import PlantAround
from arm3dof.sim.world import World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.state import Array, JointState
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import Image

_NOISE = 2.0  # of the sensor [grey levels]
_MOVED = 1e-4  # what moves less looks the same [m, rad]
_STILLS = 4  # pictures of a world that stands still, which then go round


class PhysicsPlant(PlantAround[MujocoPlant]):
    """An arm with a gripper on a table with objects, that can be rebuilt while it moves."""

    def __init__(self, robot: Robot, world: World, dt: float = PLANT_DT) -> None:
        """Create a plant at rest in the middle of the joint range."""
        super().__init__(MujocoPlant(robot, world, dt=dt))
        self._urdf = robot.description.urdf
        self._fingers = finger_joints(robot)

    @property
    def opening(self) -> float:
        """Distance between the fingers [m]; NaN for an arm without."""
        return self.plant.gripper.opening if self.plant.has_gripper else float("nan")

    @property
    def bodies(self) -> Array:
        """Pose of each object: (x, y, z, qw, qx, qy, qz), shape (n, 7)."""
        plant = self.plant
        joints = [plant.data.joint(body.name) for body in plant.world.bodies]
        return np.array([joint.qpos for joint in joints]).reshape(-1, 7)

    @property
    def gripper(self) -> GripperState:
        """What the gripper says of itself."""
        return self.plant.gripper

    @property
    def fingers(self) -> Array:
        """Positions of the two fingers, shape (2,) [m]; NaN for an arm without."""
        if not self._fingers:
            return np.full(2, np.nan)
        return np.array([self.plant.data.joint(name).qpos[0] for name in self._fingers])

    def measure(self) -> JointState:
        """Return the state as the encoders tell it."""
        return self.plant.measure()

    def step(self, tau: ArrayLike, *, external_torque: ArrayLike | None = None) -> JointState:
        """Hold a torque for ``dt`` while the surroundings push; return the state after it."""
        return self.plant.step(tau, external_torque=external_torque)

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state, everything else as the world says, and return the state."""
        return self.plant.reset(state)

    def change_robot(self, robot: Robot) -> None:
        """Go on with another arm of the same joints, everything where it is."""
        if robot.description.urdf == self._urdf:  # only the payload differs
            self.plant.change_robot(robot)
            return
        before = self.plant
        bare = robot.without_payload()
        self.plant = MujocoPlant(bare, before.world, dt=before.dt)
        self.plant.reset(before.state)
        if before.has_gripper:
            self.plant.command_gripper(before.gripper.command)
        self.plant.data.qpos[:] = before.data.qpos
        self.plant.data.qvel[:] = before.data.qvel
        self.plant.change_robot(robot)
        self._urdf = robot.description.urdf

    def grip(self, opening: float) -> None:
        """Command the distance between the fingers [m]."""
        self.plant.command_gripper(opening)

    def restart(self, q: Array) -> None:
        """Put the arm to a position, at rest, and every object to its place; time goes on."""
        self.reset(JointState(self.state.t, q, np.zeros(self.robot.nv)))


class LiveCamera:
    """A camera in the world of an arm that lives in another process, seen through its frames.

    It keeps a copy of that world, which it puts into the state of the newest frame.
    """

    def __init__(self, robot: PackedRobot, world: World, camera: Camera, ring: Ring) -> None:
        """Put the camera up.

        Args:
            robot: the arm.
            world: what stands around it.
            camera: the camera.
            ring: the frames of the arm's process.
        """
        self._world, self._camera, self._ring = world, camera, ring
        self._rng = np.random.default_rng(0)
        self._seen: Array | None = None
        self._stills: list[Image] = []
        self._shown = 0
        self._eye: WorldCamera | None = None
        self._glance: WorldCamera | None = None
        self.change_robot(robot)

    def change_robot(self, robot: PackedRobot) -> None:
        """See another arm in place of the one before."""
        self._robot = robot.unpack()
        self._fingers = finger_joints(self._robot)
        self._build(self._world)

    def take(self, watch: Watch, measured: bool = True) -> Image:
        """Take a picture of the newest frame, under the light that is asked for.

        What moves is drawn without smooth edges where nothing is measured: in half the time.
        """
        if watch.light != self._world.light:
            self._build(replace(self._world, light=watch.light))
        frame = self._ring.latest()
        if frame is not None:
            self._place(frame)
        q = np.array(self._plant.data.qpos)
        if self._seen is None or np.abs(self._seen - q).max() > _MOVED:
            self._seen, self._stills = q, []
            if not measured and self._glance is not None:
                return self._glance.take()
        if len(self._stills) < _STILLS and self._eye is not None:
            self._stills.append(self._eye.take())
        self._shown += 1
        return self._stills[-1 if len(self._stills) < _STILLS else self._shown % _STILLS]

    def _place(self, frame: Frames) -> None:
        data = self._plant.data
        names = (*self._robot.joint_names, *self._fingers)
        for name, value in zip(names, [*frame["q"], *frame["fingers"]], strict=False):
            data.joint(name).qpos[0] = value
        for body, pose in zip(self._world.bodies, frame["bodies"], strict=True):
            data.joint(body.name).qpos[:] = pose

    def _build(self, world: World) -> None:
        for eye in (self._eye, self._glance):
            if eye is not None:
                eye.close()
        self._world, self._seen = world, None
        self._plant = MujocoPlant(self._robot, world)
        self._eye, self._glance = self._open(smooth=True), self._open(smooth=False)

    def _open(self, *, smooth: bool) -> WorldCamera:
        camera = self._camera
        return WorldCamera(
            self._plant,
            camera.camera_matrix,
            camera.transform_base_camera,
            camera.width,
            camera.height,
            distortion=camera.distortion,
            noise=_NOISE,
            shadows=False,
            smooth=smooth,
            onto_last=True,
            rng=self._rng,
        )


def finger_joints(robot: Robot) -> tuple[str, ...]:
    """Return the names of the fingers' joints; none for an arm without a gripper."""
    gripper = find_gripper(robot)
    return () if gripper is None else gripper.joints

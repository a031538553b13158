"""A task in the physics world: the plant, the camera, the eye, what may be wrong, and a judge.

The task gets pictures, joint angles and the gripper's word. The judge alone looks at the bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm3dof.closing import Closing
from arm3dof.control.step import ControlStep
from arm3dof.model.robot import Robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.table_scenes import COLOURS as RANGES
from arm3dof.runtime.tasks.goals import Goal
from arm3dof.runtime.tasks.gripping import Gripping
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.pick_and_place import PickAndPlace
from arm3dof.runtime.tasks.run import TaskResult, run_task
from arm3dof.runtime.tasks.sight import SimulatedEye
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.servo import Servo
from arm3dof.sim.world import World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.state import Array, JointState
from arm3dof.vision.camera import Camera, look_at
from arm3dof.vision.colour import ColourTarget

PLANT_DT = 0.002
"""Step of the physics [s]."""
HOME = (0.11, 0.0, 0.12)
"""Where the tool waits while the camera looks, in the base frame [m]."""
LIFTED_ENOUGH = 0.05
"""A body that was lifted by this much was lifted [m]."""
PLACED_WITHIN = 0.01
"""A body that stands this near to its place was placed [m]."""
_NOISE = 2.0  # of the camera's sensor [grey levels]
_RESTING = 0.004  # a body whose middle is this near to where it would stand rests [m]


def task_camera() -> Camera:
    """Return the camera of tasks: in front of the arm, looking down on its table, 0.5 m away."""
    pose = look_at([0.44, 0.0, 0.30], [0.16, 0.0, -0.10])
    return Camera.pinhole(640, 480, 640.0, pose)


def task_targets(names: Sequence[str] = tuple(RANGES)) -> tuple[ColourTarget, ...]:
    """Return coloured targets of about the size that the gripper takes."""
    return tuple(ColourTarget(name, RANGES[name][1], 0.03, "cylinder") for name in names)


@dataclass(frozen=True)
class Faults:
    """What is wrong with an arm and its eye, and what nobody tells the task.

    Attributes:
        friction: Coulomb friction of each joint [N m].
        damping: further viscous friction [N m s/rad].
        backlash: play of each servo's gears [rad].
        noise: standard deviation of the encoders [rad].
        camera_delay: from a picture to knowing what it shows [s].
        mass_error: of the links and of what is held [%].
    """

    friction: float = 0.03
    damping: float = 0.005
    backlash: float = float(np.deg2rad(1.0))
    noise: float = float(np.deg2rad(0.1))
    camera_delay: float = 0.03
    mass_error: float = 20.0

    def servo(self, robot: Robot) -> Servo:
        """Return the arm's servos with these faults."""
        return Servo.named(
            "DS3218",
            robot,
            friction=self.friction,
            damping=self.damping,
            backlash=self.backlash,
            noise=self.noise,
            resolution=2 * np.pi / 4096,
        )


@dataclass(frozen=True, eq=False)
class Verdict:
    """What became of one body.

    Attributes:
        lifted: how far its middle rose [m].
        x: where its middle is at the end [m].
        y: where its middle is at the end [m].
        rests: whether it is as high as if it stood, not held and not thrown over.
    """

    lifted: float
    x: float
    y: float
    rests: bool

    def misses(self, x: float, y: float) -> float:
        """Return how far it is from a place [m]."""
        return float(np.hypot(self.x - x, self.y - y))


@dataclass(frozen=True)
class Judgement:
    """What the physics says of a task.

    Attributes:
        outcome: how it ended, in a word.
        yes: whether it was done.
        sentence: how it ended, in a sentence.
        figures: what was measured, by name with the unit in it.
    """

    outcome: str
    yes: bool
    sentence: str
    figures: Mapping[str, object]


Judge = Callable[[TaskResult, Mapping[str, Verdict]], Judgement]
"""Judges a task by what it says of itself and by what became of the bodies."""


class SimulatedTask(Closing):
    """A world with an arm in it, ready for tasks; use it in a ``with`` block, or ``close`` it.

    Attributes:
        robot: the robot as the task and its controller know it.
        plant: the truth.
        camera: what the task's pictures are taken by.
        eye: what sees for the task.
        gripping: what says how things are grasped.
        home: where the arm waits, shape (nv,) [rad].
    """

    def __init__(
        self,
        robot: Robot,
        world: World,
        targets: Sequence[ColourTarget],
        rng: np.random.Generator,
        *,
        faults: Faults | None = None,
        camera: Camera | None = None,
    ) -> None:
        """Set a world up, the arm at home.

        Args:
            robot: the robot as its model states it.
            world: what stands around it.
            targets: what the eye looks for.
            rng: source of all noise, and of the mass errors.
            faults: what is wrong; nothing without.
            camera: what pictures are taken by; ``task_camera()`` without.
        """
        self.robot = robot
        true, servo, delay = robot, None, 0.0
        if faults is not None:
            true = perturbed(robot, faults.mass_error, rng=rng)
            servo, delay = faults.servo(robot), faults.camera_delay
        self.plant = MujocoPlant(true, world, dt=PLANT_DT, servo=servo, rng=rng)
        self.gripping = Gripping(robot, world.table.height)
        solved = self.gripping.planner.solve(HOME)
        self.home = np.zeros(robot.nv) if isinstance(solved, str) else solved
        self.plant.reset(JointState(0.0, self.home, np.zeros(robot.nv)))
        self.camera = task_camera() if camera is None else camera
        self._world_camera = WorldCamera(
            self.plant,
            self.camera.camera_matrix,
            self.camera.transform_base_camera,
            self.camera.width,
            self.camera.height,
            distortion=self.camera.distortion,
            noise=_NOISE,
            rng=rng,
        )
        self.eye = SimulatedEye(self.picture, self.camera, targets, world.table.height, delay=delay)
        self._stood = {body.name: self._pose(body.name) for body in world.bodies}
        self._highest = {name: float(pose[2, 3]) for name, pose in self._stood.items()}

    def picture(self) -> NDArray[np.uint8]:
        """Take a picture, BGR, shape (h, w, 3)."""
        return self._world_camera.take()

    def run(
        self,
        goal: Goal,
        *,
        time_limit: float = 60.0,
        watch: Callable[[JointState, ControlStep, Phase], None] | None = None,
    ) -> TaskResult:
        """Run a task to its end.

        Args:
            goal: what it is for.
            time_limit: how long it may take [s].
            watch: called after each control step.
        """
        task = PickAndPlace(goal, self.gripping, self.home, time_limit=time_limit)

        def judge(state: JointState, answer: ControlStep, phase: Phase) -> None:
            for name in self._highest:
                height = float(self._pose(name)[2, 3])
                self._highest[name] = max(self._highest[name], height)
            if watch is not None:
                watch(state, answer, phase)

        return run_task(task, self.plant, self.eye, self.robot, watch=judge)

    def verdict(self, name: str) -> Verdict:
        """Return what became of a body."""
        start, now = self._stood[name], self._pose(name)
        return Verdict(
            lifted=self._highest[name] - float(start[2, 3]),
            x=float(now[0, 3]),
            y=float(now[1, 3]),
            rests=abs(float(now[2, 3] - start[2, 3])) < _RESTING,
        )

    def close(self) -> None:
        """Give back what the camera draws with."""
        self._world_camera.close()

    def _pose(self, name: str) -> Array:
        return self.plant.body_pose(name)

"""One trial of grasping: a random object in the graspable region, to a random place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from arm3dof.control.step import ControlStep
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.campaign import Outcome
from arm3dof.runtime.tasks.clearance import Obstacle
from arm3dof.runtime.tasks.goals import Grasping
from arm3dof.runtime.tasks.gripping import Grip, Gripping, Placing
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.run import TaskResult
from arm3dof.runtime.tasks.simulated import (
    LIFTED_ENOUGH,
    PLACED_WITHIN,
    Faults,
    Judgement,
    SimulatedTask,
    Verdict,
    task_targets,
)
from arm3dof.sim.world import COLOURS, SHAPES, Body, World
from arm3dof.state import JointState
from arm3dof.vision.standing import Standing

WIDTHS, HEIGHTS, MASSES = (0.020, 0.040), (0.030, 0.070), (0.010, 0.060)
"""Of the objects: width and height [m], mass [kg]."""
LIGHTS = (0.3, 2.0)
"""Of the light; 1 exposes a picture well."""
RADII, BEARINGS = (0.12, 0.235), (-1.0, 1.0)
"""Where objects are tried: distance from the base's axis [m], and angle [rad]. At 0.245 m the arm
is all but stretched out, and a millimetre that the eye is off decides."""
_FARTHEST_CARRY = 0.025  # a place is this much nearer or farther than the object at most [m]
_LEAST_CARRY = 0.05  # and this far from it at least [m]
_TRIES = 1000
_KNOWN_PLACE = 1e-6 * np.eye(2)  # of an object whose place is drawn, not seen [m^2]


@dataclass(frozen=True)
class GraspTask:
    """An object and where it belongs.

    Attributes:
        world: the object on its table, in its light.
        target: name of its colour.
        place: (x, y) [m].
    """

    world: World
    target: str
    place: tuple[float, float]

    @property
    def body(self) -> Body:
        """The object."""
        return self.world.bodies[0]


@dataclass(frozen=True)
class GraspTrial:
    """One object is grasped, lifted and placed.

    It succeeds when the object itself was lifted 5 cm and rests within 1 cm of its place.

    Attributes:
        faults: what is wrong with the arm and its eye; nothing when None.
    """

    faults: Faults | None = None

    def __call__(self, rng: np.random.Generator) -> Outcome:
        """Set a table, run the task, and judge the object."""
        robot = load_robot("arm3dof")
        task = random_grasp(robot, rng)
        result, verdict = self.run(robot, task, rng)
        found = judge(task, result, verdict)
        figures = {
            "lift_m": verdict.lifted,
            "place_error_m": verdict.misses(*task.place),
            "duration_s": result.duration,
        }
        return Outcome("" if found.yes else found.sentence, figures)

    def run(
        self,
        robot: Robot,
        task: GraspTask,
        rng: np.random.Generator,
        watch: Callable[[SimulatedTask, JointState, ControlStep, Phase], None] | None = None,
    ) -> tuple[TaskResult, Verdict]:
        """Run the task.

        Args:
            robot: the robot as its model states it.
            task: what is to be done.
            rng: source of all noise.
            watch: called after each control step.
        """
        error = 0.0 if self.faults is None else self.faults.mass_error / 100
        believed = task.body.mass * (1 + error * rng.uniform(-1, 1))
        with SimulatedTask(robot, task.world, task_targets(), rng, faults=self.faults) as scene:
            goal = Grasping(task.target, task.place, believed)
            seen = None if watch is None else (lambda *it: watch(scene, *it))
            result = scene.run(goal, watch=seen)
            return result, scene.verdict(task.body.name)


def judge(task: GraspTask, result: TaskResult, verdict: Verdict) -> Judgement:
    """Say whether an object was lifted and placed, and if not, why."""
    miss = verdict.misses(*task.place)
    lifted = verdict.lifted >= LIFTED_ENOUGH
    placed = lifted and verdict.rests and miss <= PLACED_WITHIN
    sentence = "the object was lifted and placed"
    if not placed:
        told = "it says that it is done" if result.failure is None else result.failure.sentence
        sentence = (
            f"lifted {1000 * verdict.lifted:.0f} mm, {1000 * miss:.0f} mm from its place"
            f"{'' if verdict.rests else ', not standing'}; {told}"
        )
    failure = "not_placed" if result.failure is None else str(result.failure.failure)
    figures = {
        "lifted": lifted,
        "placed": placed,
        "lift_m": verdict.lifted,
        "place_error_m": miss,
        "place_m": task.place,
        "attempts": sum(step.target is Phase.CLOSE for step in result.steps),
    }
    return Judgement("placed" if placed else failure, placed, sentence, figures)


def random_grasp(robot: Robot, rng: np.random.Generator) -> GraspTask:
    """Draw an object in the graspable region, and a place for it.

    Args:
        robot: the robot.
        rng: decides everything.

    Raises:
        InputError: this robot can grasp none of what is drawn.
    """
    gripping = gripping_of(robot)
    for _ in range(_TRIES):
        body, target = _object(rng)
        grip = gripping.grip(as_seen(body))
        place = draw_place(rng, gripping, grip) if isinstance(grip, Grip) else None
        if place is not None:
            light = math.exp(rng.uniform(math.log(LIGHTS[0]), math.log(LIGHTS[1])))
            return GraspTask(World(bodies=(body,), light=light), target, place)
    raise InputError(f"{robot.name} can grasp nothing of what was drawn; give another robot")


def as_seen(body: Body) -> Standing:
    """Return a body as a perfect eye would measure it: a box by its corners."""
    name = body.name.split("_")[0]
    return Standing(name, body.x, body.y, 2 * body.reach, body.height_m, _KNOWN_PLACE)


def _object(rng: np.random.Generator) -> tuple[Body, str]:
    target = str(rng.choice(list(COLOURS)))
    shape = SHAPES[int(rng.integers(len(SHAPES)))]
    width = rng.uniform(*WIDTHS)
    height = width if shape == "cube" else rng.uniform(*HEIGHTS)
    radius = math.sqrt(rng.uniform(RADII[0] ** 2, RADII[1] ** 2))
    bearing = rng.uniform(*BEARINGS)
    body = Body(
        f"{target}_0",
        shape,
        float(width),
        float(height),
        float(rng.uniform(*MASSES)),
        COLOURS[target],
        radius * math.cos(bearing),
        radius * math.sin(bearing),
        float(rng.uniform(-math.pi, math.pi)),
    )
    return body, target


def draw_place(
    rng: np.random.Generator, gripping: Gripping, grip: Grip, others: Sequence[Obstacle] = ()
) -> tuple[float, float] | None:
    """Draw a place at which what is gripped can be put down; None when that one will not do.

    Args:
        rng: source of the place.
        gripping: what says whether it will do.
        grip: how the object is held.
        others: what stands around.
    """
    thing = grip.thing
    radius = thing.distance_to(0, 0) + rng.uniform(-_FARTHEST_CARRY, _FARTHEST_CARRY)
    bearing = rng.uniform(*BEARINGS)
    x, y = radius * math.cos(bearing), radius * math.sin(bearing)
    if thing.distance_to(x, y) < _LEAST_CARRY:
        return None
    return (x, y) if isinstance(gripping.placing(grip, x, y, others), Placing) else None


@lru_cache(maxsize=2)
def gripping_of(robot: Robot) -> Gripping:
    """Return what says how a robot grasps on the default table, made once."""
    return Gripping(robot, World().table.height)

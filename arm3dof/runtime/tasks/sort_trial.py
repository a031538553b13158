"""One trial of sorting: nine objects of three colours, each into the bin of its colour."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from arm3dof.control.step import ControlStep
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.campaign import Outcome
from arm3dof.runtime.tasks.goals import Sorting, Tray
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.run import TaskResult
from arm3dof.runtime.tasks.simulated import (
    Faults,
    Judgement,
    SimulatedTask,
    Verdict,
    task_targets,
)
from arm3dof.sim.scatter import Region, scatter
from arm3dof.sim.world import COLOURS, Bin, World
from arm3dof.state import JointState

COUNT = 9
SORTED = ("red", "green", "blue")
REGION = Region(radius=(0.135, 0.225), bearing=(-0.85, 0.95))
WIDTHS, HEIGHTS, MASSES = (0.020, 0.030), (0.030, 0.050), (0.010, 0.060)
"""Of the objects: width and height [m], mass [kg]."""
GAP = 0.024
"""Least gap between two of them [m]."""
LIGHTS = (0.6, 1.6)
"""Of the light; 1 exposes a picture well."""
TIME_LIMIT = 240.0
"""For all of them [s]."""
_BELIEVED_MASS = 0.035  # of each of them [kg]
_BIN_RADIUS, _BIN_HALF = 0.19, (0.06, 0.06)  # [m]
_BIN_BEARINGS = (-1.38, 1.65, -2.08)  # [rad]; the base turns to -2.35


@dataclass(frozen=True)
class SortTrial:
    """A table is cleared: nine objects into three bins.

    It succeeds when every object rests in its bin. The figures count the objects.

    Attributes:
        faults: what is wrong with the arm and its eye; nothing when None.
    """

    faults: Faults | None = None

    def __call__(self, rng: np.random.Generator) -> Outcome:
        """Set a table, run the task, and judge the objects."""
        robot, world = load_robot("arm3dof"), random_table(rng)
        result, verdicts = self.run(robot, world, rng)
        found = judge(world, result, verdicts)
        figures = {name: float(str(value)) for name, value in found.figures.items()}
        reason = "" if found.yes else found.sentence
        return Outcome(reason, figures | {"duration_s": result.duration})

    def run(
        self,
        robot: Robot,
        world: World,
        rng: np.random.Generator,
        watch: Callable[[SimulatedTask, JointState, ControlStep, Phase], None] | None = None,
    ) -> tuple[TaskResult, dict[str, Verdict]]:
        """Run the task.

        Args:
            robot: the robot as its model states it.
            world: the table.
            rng: source of all noise.
            watch: called after each control step.
        """
        targets = task_targets(tuple(tray.name for tray in world.bins))
        with SimulatedTask(robot, world, targets, rng, faults=self.faults) as scene:
            seen = None if watch is None else (lambda *it: watch(scene, *it))
            result = scene.run(sorting(world), time_limit=TIME_LIMIT, watch=seen)
            return result, {body.name: scene.verdict(body.name) for body in world.bodies}


def random_table(rng: np.random.Generator, count: int = COUNT) -> World:
    """Draw a table with objects of three colours in turn, and a bin for each colour.

    Args:
        rng: source of everything that is drawn.
        count: how many objects.

    Raises:
        InputError: there is no room for so many.
    """
    trays = tuple(_bin(*it) for it in zip(SORTED, _BIN_BEARINGS, strict=True))
    colours = {name: COLOURS[name] for name in SORTED}
    bodies = scatter(
        rng,
        count,
        colours=colours,
        region=REGION,
        width_m=WIDTHS,
        height_m=HEIGHTS,
        mass=MASSES,
        gap_m=GAP,
        bins=trays,
    )
    light = math.exp(rng.uniform(math.log(LIGHTS[0]), math.log(LIGHTS[1])))
    return World(bodies=bodies, bins=trays, light=light)


def judge(world: World, result: TaskResult, verdicts: Mapping[str, Verdict]) -> Judgement:
    """Say which objects lie in their bins."""
    trays = {tray.name: tray for tray in world.bins}
    wrong, fallen = [], 0
    for body in world.bodies:
        verdict = verdicts[body.name]
        fallen += not world.on_table(verdict.x, verdict.y)
        if not trays[body.name.split("_")[0]].holds(verdict.x, verdict.y):
            wrong.append(f"{body.name} at ({verdict.x:.2f}, {verdict.y:.2f})")
    told = "" if result.failure is None else f"; {result.failure.sentence}"
    sentence = "every object is in the bin of its colour"
    if wrong:
        sentence = f"not in its bin: {', '.join(wrong)}{told}"
    figures = {
        "objects_in_all": len(world.bodies),
        "objects_sorted": len(world.bodies) - len(wrong),
        "objects_fallen": fallen,
    }
    return Judgement("not_sorted" if wrong else "sorted", not wrong, sentence, figures)


def sorting(world: World) -> Sorting:
    """Return the goal of sorting a world's objects into its bins."""
    return Sorting([tray_of(tray) for tray in world.bins], _BELIEVED_MASS)


def tray_of(tray: Bin) -> Tray:
    """Return a bin as the task knows it."""
    return Tray(tray.name, tray.x, tray.y, tray.half_size, tray.wall_m)


def _bin(name: str, bearing: float) -> Bin:
    x, y = _BIN_RADIUS * math.cos(bearing), _BIN_RADIUS * math.sin(bearing)
    pale = tuple(0.55 + 0.25 * share for share in COLOURS[name])
    return Bin(name, x, y, _BIN_HALF, (pale[0], pale[1], pale[2]))

"""The options of ``arm3dof simulate`` by which the simulated arm differs from its model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import partial
from typing import Annotated

import numpy as np
import typer

from arm3dof.cli.options import number
from arm3dof.cli.units import from_degrees, unit
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.experiment import PlantFactory
from arm3dof.sim.disturbance import DisturbedPlant, Push, Wrench
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.plant import DisturbablePlant, Plant
from arm3dof.sim.table import Table
from arm3dof.sim.world import World

PayloadKg = Annotated[
    float,
    typer.Option(
        metavar="M", min=0, help="Mass at the tool that the controller knows nothing of, in kg."
    ),
]
Pushes = Annotated[
    list[str] | None,
    typer.Option(
        "--push",
        metavar="T,JOINT,DEG",
        help="At T seconds a joint is displaced: its name, or its number from 1. Repeatable.",
        show_default=False,
    ),
]
Wrenches = Annotated[
    list[str] | None,
    typer.Option(
        "--wrench",
        metavar="T,FX,FY,FZ,DURATION",
        help="A force on the tool, in newtons along the base axes, from T seconds on. Repeatable.",
        show_default=False,
    ),
]
ModelError = Annotated[
    float,
    typer.Option(
        metavar="PCT",
        min=0,
        help="Every link's mass, inertia and centre of mass is wrong by up to PCT percent.",
    ),
]
NoiseDeg = Annotated[
    float,
    typer.Option(metavar="S", min=0, help="Standard deviation of the measured angles, in degrees."),
]
DelayMs = Annotated[
    float,
    typer.Option(metavar="D", min=0, help="Torques act D milliseconds after they are commanded."),
]
Seed = Annotated[
    int, typer.Option(metavar="N", min=0, help="Seed of the model's errors and of the noise.")
]


class Engine(StrEnum):
    """What simulates the arm."""

    PINOCCHIO = "pinocchio"
    MUJOCO = "mujoco"

    def note(self) -> dict[str, str]:
        """Return what a recording is to remember: the engine, where it is not the usual one."""
        return {} if self is Engine.PINOCCHIO else {"plant": self.value}


PlantName = Annotated[
    Engine,
    typer.Option(
        "--plant",
        help="What simulates the arm, in free space: MuJoCo moves the gripper too, stops joints "
        "at their ends and needs the extra 'physics'.",
    ),
]


@dataclass(frozen=True)
class Disturbances:
    """What the options say, as they were typed.

    Attributes:
        payload_kg: mass at the tool [kg].
        pushes: values of ``--push``.
        wrenches: values of ``--wrench``.
        model_error: largest error of masses, inertias and centres of mass [%].
        noise_deg: standard deviation of measured angles [deg].
        delay_ms: time from command to torque [ms].
        seed: of the errors and the noise.
    """

    payload_kg: float
    pushes: Sequence[str]
    wrenches: Sequence[str]
    model_error: float
    noise_deg: float
    delay_ms: float
    seed: int

    def notes(self) -> dict[str, str]:
        """Return what a recording is to remember: every option that is not 0 or absent."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: "; ".join(value) if isinstance(value, Sequence) else f"{value:g}"
            for name, value in values.items()
            if value
        }

    def plant_of(
        self, robot: Robot, duration: float, engine: Engine = Engine.PINOCCHIO
    ) -> PlantFactory:
        """Return what makes the plant, with every option checked.

        Args:
            robot: the robot as the controller knows it.
            duration: length of the run [s].
            engine: what simulates the arm.

        Raises:
            InputError: a value is not what its option asks for.
            MissingExtra: the engine is not installed.
        """
        bare_plant = _maker(engine)
        for_model, for_noise = np.random.default_rng(self.seed).spawn(2)
        moves = [_push(robot, text, duration) for text in self.pushes]
        forces = [_wrench(text, duration) for text in self.wrenches]
        truth = robot
        if self.model_error:
            truth = perturbed(truth, self.model_error, rng=for_model)
        if self.payload_kg:
            truth = truth.with_payload(self.payload_kg)
        turns = np.array([unit(robot, joint) == "deg" for joint in range(robot.nv)])
        noise = np.where(turns, np.deg2rad(self.noise_deg), 0.0)

        def make_plant(_: Robot, dt: float) -> Plant:
            return DisturbedPlant(
                bare_plant(truth, dt),
                pushes=moves,
                wrenches=forces,
                delay=self.delay_ms / 1000,
                noise=noise,
                rng=for_noise,
            )

        return make_plant


def _maker(engine: Engine) -> Callable[[Robot, float], DisturbablePlant]:
    if engine is Engine.PINOCCHIO:
        return partial(PinocchioPlant, end_stops=True)
    from arm3dof.sim.mujoco_plant import MujocoPlant  # an extra, and slow to import

    # where a robot's table is, its URDF does not say: there is nothing within reach
    free = World(table=Table(height=-100.0))
    return lambda robot, dt: MujocoPlant(robot, free, dt=dt)


def _push(robot: Robot, text: str, duration: float) -> Push:
    parts = [part.strip() for part in text.split(",")]
    what = f"--push '{text}'"
    if len(parts) != 3:
        raise InputError(f"{what}: write T,JOINT,DEG, for example 2,{robot.joint_names[-1]},10")
    joint = _joint(robot, parts[1], what)
    t = _time(parts[0], what, duration)
    return Push(t, joint, from_degrees(robot, joint, number(parts[2], what)))


def _joint(robot: Robot, text: str, what: str) -> int:
    """Return the index of a joint that is given by its name, or by its number from 1."""
    names = robot.joint_names
    if text in names:
        return names.index(text)
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return int(text) - 1
    known = ", ".join(names)
    raise InputError(f"{what}: no joint '{text}'; give a number from 1, or one of: {known}")


def _wrench(text: str, duration: float) -> Wrench:
    what = f"--wrench '{text}'"
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 5:
        raise InputError(f"{what}: write T,FX,FY,FZ,DURATION, for example 2,0,0,-5,0.2")
    force = [number(part, what) for part in parts[1:4]]
    lasting = number(parts[4], what)
    if lasting <= 0:
        raise InputError(f"{what} lasts {parts[4]} s; give a duration above 0 s")
    return Wrench(_time(parts[0], what, duration), np.array(force), duration=lasting)


def _time(text: str, what: str, duration: float) -> float:
    t = number(text, what)
    if not 0 <= t < duration:
        raise InputError(f"{what} is at {text} s; give a time from 0 to below {duration:g} s")
    return t

"""Moves under nominal and disturbed conditions, on which controllers are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.experiment import default_start, default_target
from arm3dof.sim.disturbance import DisturbedPlant, Push
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.plant import Plant
from arm3dof.state import Array, JointState, frozen_array

DURATION = 4.0
"""Length of a scenario [s]."""
_PUSH_TIME = 2.0  # [s]
_PLANT_DT = 0.0025  # [s]
_RANDOM_MOVES = {"quick": 3, "full": 15}
_LONGEST_MOVE = 1.5  # [rad]
_RANGE = 0.9  # share of each joint's range in which moves start and end


@dataclass(frozen=True)
class Condition:
    """What befalls the simulated arm; its controller is told nothing of it.

    Attributes:
        name: short name.
        payload: mass at the tool [kg].
        model_error: largest error of each link's mass, inertia and centre of mass [%].
        push: displacement of one joint, two seconds into the move [rad].
        noise: standard deviation of measured positions [rad].
    """

    name: str
    payload: float = 0.0
    model_error: float = 0.0
    push: float = 0.0
    noise: float = 0.0


CONDITIONS = (
    Condition("nominal"),
    Condition("payload 0.1 kg", payload=0.1),
    Condition("model error 30 %", model_error=30.0),
    Condition("push 10 deg", push=float(np.deg2rad(10.0))),
    Condition("noise 0.1 deg", noise=float(np.deg2rad(0.1))),
)
"""The conditions of every scenario set."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """One move under one condition.

    Attributes:
        condition: what befalls the arm.
        start: joint positions at rest, shape (nv,) [rad].
        target: joint positions to reach, shape (nv,) [rad].
        seed: of the wrong masses, the pushed joint and the noise.
    """

    condition: Condition
    start: Array
    target: Array
    seed: int

    @property
    def event_time(self) -> float:
        """When the arm was last pushed, 0 when it never was [s]."""
        return _PUSH_TIME if self.condition.push else 0.0

    def plant(self, robot: Robot, control_dt: float) -> Plant:
        """Return the simulated arm, at rest at the start.

        Args:
            robot: the robot as its controller knows it.
            control_dt: time between two control steps, which the plant's step divides [s].
        """
        condition = self.condition
        for_model, for_push, for_noise = np.random.default_rng(self.seed).spawn(3)
        truth = robot
        if condition.model_error:
            truth = perturbed(truth, condition.model_error, rng=for_model)
        if condition.payload:
            truth = truth.with_payload(condition.payload)
        pushes = []
        if condition.push:
            joint, sign = int(for_push.integers(robot.nv)), float(for_push.choice([-1.0, 1.0]))
            pushes.append(Push(_PUSH_TIME, joint, sign * condition.push))
        dt = control_dt / np.ceil(control_dt / _PLANT_DT - 1e-9)
        inner = PinocchioPlant(truth, dt)
        plant = DisturbedPlant(inner, pushes=pushes, noise=condition.noise, rng=for_noise)
        plant.reset(JointState(0.0, self.start, np.zeros(robot.nv)))
        return plant


def scenario_set(robot: Robot, size: str = "quick", seed: int = 0) -> tuple[Scenario, ...]:
    """Return moves under each of ``CONDITIONS``: the paper's experiment, then random moves.

    A random move starts anywhere in the inner 90 % of the joint ranges and turns each joint by up
    to 1.5 rad, as far as that range allows. Every condition gets the same moves.

    Args:
        robot: the robot.
        size: ``"quick"``: 3 random moves; ``"full"``: 15.
        seed: of the moves and of what befalls the arm.

    Raises:
        InputError: the size is another word.
    """
    if size not in _RANDOM_MOVES:
        raise InputError(f"scenarios is '{size}'; give one of: {', '.join(_RANDOM_MOVES)}")
    rng = np.random.default_rng(seed)
    start = default_start(robot)
    moves = [(start, default_target(robot, start))]
    moves += [_random_move(robot, rng) for _ in range(_RANDOM_MOVES[size])]
    seeds = rng.integers(2**31, size=len(moves)).tolist()
    return tuple(
        Scenario(condition, *move, seed=seed_of_move)
        for condition in CONDITIONS
        for move, seed_of_move in zip(moves, seeds, strict=True)
    )


def _random_move(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    limits, nv = robot.limits, robot.nv
    low, high = (
        np.nan_to_num(end, posinf=np.pi, neginf=-np.pi) for end in (limits.q_min, limits.q_max)
    )
    middle, half = (low + high) / 2, _RANGE * (high - low) / 2
    start = rng.uniform(middle - half, middle + half)
    target = start + rng.uniform(-_LONGEST_MOVE, _LONGEST_MOVE, nv)
    target = np.clip(target, middle - half, middle + half)
    return frozen_array(start, nv, name="start"), frozen_array(target, nv, name="target")

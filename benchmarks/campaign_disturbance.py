"""Loads, pushes, moments and delay: what is left of them with the observer, and without it."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm3dof import JointState, MpcController, MpcSettings, PinocchioPlant, Recording, load_robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import SETTLED_ERROR, summarise
from arm3dof.sim.disturbance import DisturbedPlant, JointTorque, Push
from benchmarks.tables import Table

TARGET = np.deg2rad([28.1, 67.8, 53.8])
PAYLOAD, MASS_ERROR = 0.1, 30.0  # [kg], [%]
DELAY = 0.05  # [s]
STRUCK_AT = 1.5  # [s]
BRISK = {"input_weight": 3e-5}
CALM = {"input_weight": 1e-3}


def run() -> dict[str, Any]:
    """Measure everything; seconds, degrees."""
    robot = load_robot("arm3dof")
    found: dict[str, Any] = {"load": [], "struck": [], "delay": []}
    for sign in (1, -1):
        truth = perturbed(robot, MASS_ERROR, sign=sign, centroid_percent=0).with_payload(PAYLOAD)
        for formulation in ("tracking", "torque"):
            with_observer, without = (
                float(np.rad2deg(summarise(_run(PinocchioPlant(truth), **settings)).final_error))
                for settings in (
                    {"formulation": formulation},
                    {"formulation": formulation, "observer_gain": 0.0},
                )
            )
            found["load"].append(
                (f"{100 * sign * 0.3:+.0f} %", formulation, with_observer, without)
            )
    for joint, name in enumerate(robot.joint_names):
        push = DisturbedPlant(
            PinocchioPlant(robot), pushes=[Push(STRUCK_AT, joint, np.deg2rad(10))]
        )
        moment = DisturbedPlant(
            PinocchioPlant(robot), wrenches=[JointTorque(STRUCK_AT, joint, 0.5, 0.2)]
        )
        for what, plant in (("10 deg push", push), ("0.5 N m for 0.2 s", moment)):
            times = [_back_inside(_run(plant, **settings)) for settings in (BRISK, {})]
            found["struck"].append((f"{what}, {name}", *times))
    late = DisturbedPlant(PinocchioPlant(robot), delay=DELAY)
    for name, plant, settings in (
        ("no delay", PinocchioPlant(robot), CALM),
        ("50 ms, compensated", late, {**CALM, "delay": DELAY}),
        ("50 ms, not compensated", late, CALM),
    ):
        metrics = summarise(_run(plant, **settings))
        found["delay"].append((name, metrics.settling_time, float(np.rad2deg(metrics.rms_error))))
    return found


def tables(found: dict[str, Any]) -> list[Table]:
    """Return the tables of what was measured."""
    load = Table(
        f"Unknown payload of {PAYLOAD} kg, all masses wrong: steady error",
        ("masses", "formulation", "with observer [deg]", "without [deg]"),
        [(*row[:2], f"{row[2]:.1e}", f"{row[3]:.2f}") for row in found["load"]],
        "At the end of 3 s.",
    )
    struck = Table(
        "Pushes and moments: time until every joint stays inside 0.5 deg again",
        ("disturbance", "brisk [s]", "default settings [s]"),
        [(row[0], f"{row[1]:.2f}", f"{row[2]:.2f}") for row in found["struck"]],
        "Brisk: input_weight 3e-5. The time counts from the beginning of the "
        "disturbance; one second is the goal.",
    )
    delay = Table(
        "Torques that act 50 ms late",
        ("what", "settling time [s]", "RMS error [deg]"),
        [
            (name, "does not settle" if time is None else f"{time:.2f}", f"{error:.2f}")
            for name, time, error in found["delay"]
        ],
        "With input_weight 1e-3, over 3 s.",
    )
    return [load, struck, delay]


def _run(plant: PinocchioPlant | DisturbedPlant, **settings: Any) -> Recording:
    robot = load_robot("arm3dof")
    plant.reset(JointState(0.0, np.zeros(robot.nv), np.zeros(robot.nv)))
    return run_loop(plant, MpcController(robot, MpcSettings(**settings)), TARGET, 3.0)


def _back_inside(recording: Recording) -> float:
    """Return how long after the blow an error is outside for the last time [s]."""
    outside = (np.abs(recording.e) > SETTLED_ERROR).any(axis=1) & (recording.t >= STRUCK_AT)
    return float(recording.t[outside][-1] - STRUCK_AT) if outside.any() else 0.0

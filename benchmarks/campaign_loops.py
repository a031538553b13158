"""Random closed loops with wrong masses and noisy encoders: how many settle, and why not all."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np

from arm3dof import (
    JointState,
    MpcController,
    MpcSettings,
    PinocchioPlant,
    Recording,
    inverse_kinematics,
    load_robot,
    run_loop,
)
from arm3dof.model.robot import Robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.metrics import SETTLED_ERROR, SETTLED_SPEED, summarise
from arm3dof.sim.disturbance import DisturbedPlant
from arm3dof.state import Array
from benchmarks.tables import Table

IN_TIME = 2.0  # [s]
WATCHED = 0.5  # [s]: how long after that a settled arm is watched
PLANT_DT = 0.002  # [s]
_AT_END = 1e-4  # [rad]


@dataclass(frozen=True)
class Conditions:
    """What every loop of a campaign has in common.

    Attributes:
        settings: of the controller, which believes the nominal robot.
        model_error: largest error of each link's mass, inertia and centre of mass [%].
        noise_deg: standard deviation of the measured angles [deg].
    """

    settings: MpcSettings
    model_error: float = 30.0
    noise_deg: float = 0.1


@dataclass(frozen=True)
class Loop:
    """How one loop ended.

    Attributes:
        index: of the loop; with the seed it gives the same loop again.
        settling_time: [s]; ``None`` when it did not settle to the end.
        error_deg: largest |e| after ``IN_TIME`` [deg].
        speed: largest |v| after ``IN_TIME`` [rad/s].
        cause: why it did not settle in time; empty when it did.
    """

    index: int
    settling_time: float | None
    error_deg: float
    speed: float
    cause: str

    @property
    def in_time(self) -> bool:
        """Whether it settled in time."""
        return self.settling_time is not None and self.settling_time <= IN_TIME


def run_loops(task: tuple[Conditions, int, range]) -> list[Loop]:
    """Run some loops of a campaign: conditions, seed, and which loops."""
    conditions, seed, indices = task
    return [_run_one(conditions, seed, index) for index in indices]


def summary(loops: list[Loop]) -> dict[str, object]:
    """Return what a campaign found."""
    times = [loop.settling_time for loop in loops if loop.settling_time is not None]
    late = [loop for loop in loops if not loop.in_time]
    causes: dict[str, int] = {}
    for loop in late:
        causes[loop.cause] = causes.get(loop.cause, 0) + 1
    return {
        "loops": len(loops),
        "settled_in_time": len(loops) - len(late),
        "fraction": (len(loops) - len(late)) / len(loops),
        "settling_time_s": dict(
            zip(("p50", "p99", "max"), np.percentile(times, [50, 99, 100]).tolist(), strict=True)
        )
        if times
        else None,
        "error_deg_max": max(loop.error_deg for loop in loops),
        "speed_p99": float(np.percentile([loop.speed for loop in loops], 99)),
        "causes": causes,
        "not_in_time": [asdict(loop) for loop in late],
    }


def table(found: dict[str, dict[str, object]]) -> Table:
    """Return the table of campaigns, by name."""
    rows = []
    for name, result in found.items():
        times = result["settling_time_s"] or {"p50": np.nan, "p99": np.nan}
        causes = "; ".join(f"{cause}: {count}" for cause, count in result["causes"].items())
        rows.append(
            (
                name,
                f"{result['loops']:,}",
                f"{100 * result['fraction']:.2f}",
                f"{times['p50']:.2f}",
                f"{times['p99']:.2f}",
                causes or "-",
            )
        )
    return Table(
        "Random closed loops",
        (
            "conditions",
            "loops",
            "settled in 2 s [%]",
            "p50 [s]",
            "p99 [s]",
            "why the others did not",
        ),
        rows,
        "The controller believes the nominal arm. Settled: every joint within 0.5 deg of its "
        "target and slower than 0.05 rad/s, by the true state, from that time to the end at "
        f"{IN_TIME + WATCHED} s. Causes are found by running the same loop again without noise, "
        "without model error, and for longer.",
    )


@lru_cache(maxsize=1)
def _robot() -> Robot:
    return load_robot("arm3dof")


def _run_one(conditions: Conditions, seed: int, index: int) -> Loop:
    start, target = _pair(np.random.default_rng([seed, index]))
    recording = _run(conditions, seed, index, start, target)
    metrics = summarise(recording)
    late = recording.t >= IN_TIME
    loop = Loop(
        index,
        metrics.settling_time,
        float(np.rad2deg(np.abs(recording.e[late]).max())),
        float(np.abs(recording.v[late]).max()),
        "",
    )
    if loop.in_time:
        return loop
    return replace(loop, cause=_cause(conditions, seed, index, start, target, recording))


def _pair(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a random start and a target that is reached inside the limits."""
    robot = _robot()
    start = robot.random_configuration(rng)
    if rng.random() < 0.5:
        return start, robot.random_configuration(rng)
    point = robot.placement(robot.random_configuration(rng)).translation
    best = inverse_kinematics(robot, point, near=start).best
    return start, robot.random_configuration(rng) if best is None else best


def _run(
    conditions: Conditions,
    seed: int,
    index: int,
    start: Array,
    target: Array,
    duration: float = IN_TIME + WATCHED,
) -> Recording:
    robot = _robot()
    truth = _truth(conditions, seed, index)
    plant = DisturbedPlant(
        PinocchioPlant(truth, dt=PLANT_DT, end_stops=True),
        noise=np.deg2rad(conditions.noise_deg),
        rng=np.random.default_rng([seed, index, 2]),
    )
    plant.reset(JointState(0.0, start, np.zeros(robot.nv)))
    return run_loop(plant, MpcController(robot, conditions.settings), target, duration)


def _truth(conditions: Conditions, seed: int, index: int) -> Robot:
    rng = np.random.default_rng([seed, index, 1])
    return perturbed(_robot(), conditions.model_error, rng=rng)


def _cause(
    conditions: Conditions,
    seed: int,
    index: int,
    start: Array,
    target: Array,
    recording: Recording,
) -> str:
    """Find what kept a loop from settling by taking away one thing after the other."""
    truth = _truth(conditions, seed, index)
    if (np.abs(truth.gravity(target)) > truth.limits.tau_max).any():
        return "the target needs more torque than there is"

    def settles(changed: Conditions, duration: float = IN_TIME + WATCHED) -> bool:
        time = summarise(_run(changed, seed, index, start, target, duration)).settling_time
        return time is not None and time <= duration - WATCHED

    late = recording.t >= IN_TIME
    stands_off = bool((np.abs(recording.e[late]) >= SETTLED_ERROR).any())
    too_fast = bool((np.abs(recording.v[late]) >= SETTLED_SPEED).any())
    what = " and ".join(["error"] * stands_off + ["speed"] * too_fast)
    limits = _robot().limits
    at_end = (recording.q <= limits.q_min + _AT_END) | (recording.q >= limits.q_max - _AT_END)
    if stands_off and at_end[late].all(axis=0).any():
        return "a joint leans on its end stop"
    if settles(replace(conditions, noise_deg=0.0)):
        return f"noise ({what})"
    if settles(replace(conditions, model_error=0.0)):
        return f"model error ({what})"
    if settles(conditions, 5.0):
        return f"late ({what})"
    return f"unsettled ({what})"

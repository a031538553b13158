"""Controllers side by side: the same moves, the same disturbances, one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from arm3dof.control import baselines
from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import Controller
from arm3dof.control.tuning import Gains, tune_gains
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import Metrics, summarise
from arm3dof.runtime.parallel import PackedRobot, Progress, run_all
from arm3dof.runtime.recording import Recording
from arm3dof.runtime.scenarios import DURATION, Scenario
from arm3dof.state import Array, frozen_array

ALL_CONDITIONS = "all"
"""The condition of a row that sums up every scenario."""
_LEAST_MOVE = 0.01  # [rad]: a joint that moves less cannot overshoot


@dataclass(frozen=True)
class Entrant:
    """A controller that takes part.

    Attributes:
        label: its name for people.
        make: builds it from a robot and the gains found by ``tune``, ``None`` without.
        tune: finds its gains for a robot; ``None`` for a controller without.
    """

    label: str
    make: Callable[[Robot, Gains | None], Controller]
    tune: Callable[[Robot], Gains] | None = None


_DT = MpcSettings.dt

ENTRANTS: Mapping[str, Entrant] = MappingProxyType(
    {
        "mpc-tracking": Entrant("MPC", lambda robot, _: MpcController(robot)),
        "mpc-paper": Entrant(
            "MPC of the paper",
            lambda robot, _: MpcController(robot, MpcSettings(formulation="paper")),
        ),
        "computed-torque": Entrant(
            "computed torque", lambda robot, _: baselines.computed_torque(robot)
        ),
        "pd-gravity": Entrant(
            "PD + gravity",
            lambda robot, gains: baselines.pd_gravity(robot, gains=gains),
            lambda robot: tune_gains(robot, _DT, carries_weight=True),
        ),
        "pid": Entrant(
            "PID",
            lambda robot, gains: baselines.pid(robot, gains=gains),
            lambda robot: tune_gains(robot, _DT, integrates=True),
        ),
        "pd": Entrant(
            "PD",
            lambda robot, gains: baselines.pd(robot, gains=gains),
            lambda robot: tune_gains(robot, _DT),
        ),
    }
)
"""Every controller that is compared, by name."""


@dataclass(frozen=True, eq=False)
class Run:
    """One controller in one scenario.

    Attributes:
        controller: name of the controller.
        condition: name of the condition.
        metrics: figures of merit of the recording.
        settling_time: time to settle from the last event on [s]; ``None`` when not settled.
        overshoot: how far a joint went past its target before any event [rad].
        t: times of the control steps, shape (n,) [s].
        error: root mean square over the joints of e at these times, shape (n,) [rad].
        step_time: wall times of the control steps, shape (n,) [s].
    """

    controller: str
    condition: str
    metrics: Metrics
    settling_time: float | None
    overshoot: float
    t: Array
    error: Array
    step_time: Array


@dataclass(frozen=True)
class Row:
    """How one controller did under one condition, or under all.

    Attributes:
        controller: name of the controller.
        condition: name of the condition; "all" for every scenario.
        runs: number of runs.
        rms_error: root mean square of e over runs, time and joints [rad].
        final_error: median over runs of the largest |e| at the end [rad].
        worst_final_error: largest of it [rad].
        settled: share of runs that settled.
        settling_time: median over all runs [s]; ``None`` when that run did not settle.
        overshoot: mean over runs of how far a joint went past its target [rad].
        energy: mean over runs of the integral of |tau . v| [J].
        torque_squared: mean over runs of the integral of tau . tau [N^2 m^2 s].
        saturation: share of control steps with a torque at its limit.
        torque_violations: plant steps in which a torque exceeded its limit.
        velocity_violations: plant steps in which a speed exceeded its limit by over 1 %.
        position_violations: plant steps in which a joint was over 0.5 deg outside its range.
        step_time_p50: median wall time of a control step [s].
        step_time_p99: 99th percentile of it [s].
    """

    controller: str
    condition: str
    runs: int
    rms_error: float
    final_error: float
    worst_final_error: float
    settled: float
    settling_time: float | None
    overshoot: float
    energy: float
    torque_squared: float
    saturation: float
    torque_violations: int
    velocity_violations: int
    position_violations: int
    step_time_p50: float
    step_time_p99: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """All runs, controller by controller.

    Attributes:
        runs: every run.
        gains: what the tuned controllers were given, by name.
    """

    runs: tuple[Run, ...]
    gains: Mapping[str, Gains]

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, in order."""
        return tuple(dict.fromkeys(run.controller for run in self.runs))

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions, in order."""
        return tuple(dict.fromkeys(run.condition for run in self.runs))

    def select(self, controller: str, condition: str = ALL_CONDITIONS) -> tuple[Run, ...]:
        """Return the runs of a controller under a condition, or under all."""
        return tuple(
            run
            for run in self.runs
            if run.controller == controller and condition in (run.condition, ALL_CONDITIONS)
        )

    def table(self, condition: str = ALL_CONDITIONS) -> tuple[Row, ...]:
        """Return one row a controller.

        Raises:
            InputError: no run was made under this condition.
        """
        known = (ALL_CONDITIONS, *self.conditions)
        if condition not in known:
            raise InputError(f"condition is '{condition}'; give one of: {', '.join(known)}")
        return tuple(
            _row(name, condition, self.select(name, condition)) for name in self.controllers
        )


def compare(
    robot: Robot,
    scenarios: Sequence[Scenario],
    controllers: Sequence[str] | None = None,
    *,
    workers: int = 1,
    progress: Progress | None = None,
) -> Comparison:
    """Run controllers through scenarios.

    Args:
        robot: the robot as the controllers know it.
        scenarios: what they are put through, at least one.
        controllers: names among ``ENTRANTS``; all when ``None``.
        workers: number of processes, see ``run_all``.
        progress: told of each finished run.

    Raises:
        InputError: a name is unknown, or there is nothing to run.
    """
    names = list(ENTRANTS if controllers is None else dict.fromkeys(controllers))
    unknown = [name for name in names if name not in ENTRANTS]
    if unknown:
        raise InputError(f"no controller '{unknown[0]}'; give one of: {', '.join(ENTRANTS)}")
    if not names or not scenarios:
        raise InputError("nothing to compare; give at least one controller and one scenario")
    packed = PackedRobot.of(robot)
    tuned = [name for name in names if ENTRANTS[name].tune is not None]
    tuning = run_all(_tune, [(packed, name) for name in tuned], workers=workers)
    gains = {tuned[index]: found for index, found in tuning}
    tasks = [(packed, name, gains.get(name), scenario) for name in names for scenario in scenarios]
    runs = dict(run_all(_run, tasks, workers=workers, progress=progress))
    return Comparison(tuple(runs[index] for index in range(len(tasks))), gains)


def run_scenario(robot: Robot, controller: Controller, name: str, scenario: Scenario) -> Run:
    """Put one controller through one scenario.

    Args:
        robot: the robot as the controller knows it.
        controller: the controller; it is reset first.
        name: its name in the result.
        scenario: the scenario.
    """
    controller.reset()
    plant = scenario.plant(robot, controller.dt)
    recording = run_loop(plant, controller, scenario.target, DURATION)
    metrics = summarise(recording)
    settling_time = metrics.settling_time
    if settling_time is not None:
        settling_time = max(settling_time - scenario.event_time, 0.0)
    at = recording.control_rows
    return Run(
        controller=name,
        condition=scenario.condition.name,
        metrics=metrics,
        settling_time=settling_time,
        overshoot=overshoot(recording, scenario.event_time or DURATION),
        t=recording.t[at],
        error=np.sqrt(np.mean(recording.e[at] ** 2, axis=1)),
        step_time=recording.step_time[at],
    )


def overshoot(recording: Recording, until: float) -> float:
    """Return how far a joint went past its target before a time, at most over the joints [rad]."""
    e = recording.e[recording.t - recording.t[0] < until]
    past = -e * np.sign(e[0])
    return float(past[:, np.abs(e[0]) > _LEAST_MOVE].max(initial=0.0))


def _tune(task: tuple[PackedRobot, str]) -> Gains:
    packed, name = task
    tune = ENTRANTS[name].tune
    if tune is None:
        raise InputError(f"{name} has no gains to tune")
    return tune(packed.unpack())


def _run(task: tuple[PackedRobot, str, Gains | None, Scenario]) -> Run:
    packed, name, gains, scenario = task
    robot = packed.unpack()
    return run_scenario(robot, ENTRANTS[name].make(robot, gains), name, scenario)


def _row(controller: str, condition: str, runs: Sequence[Run]) -> Row:
    def each(name: str) -> Array:
        return frozen_array([getattr(run.metrics, name) for run in runs], None, name=name)

    times = [np.inf if run.settling_time is None else run.settling_time for run in runs]
    settling_time = float(np.median(times))
    p50, p99 = np.percentile(np.concatenate([run.step_time for run in runs]), [50, 99])
    return Row(
        controller=controller,
        condition=condition,
        runs=len(runs),
        rms_error=float(np.sqrt(np.mean(each("rms_error") ** 2))),
        final_error=float(np.median(each("final_error"))),
        worst_final_error=float(each("final_error").max()),
        settled=float(each("settled").mean()),
        settling_time=settling_time if np.isfinite(settling_time) else None,
        overshoot=float(np.mean([run.overshoot for run in runs])),
        energy=float(each("energy").mean()),
        torque_squared=float(each("torque_squared").mean()),
        saturation=float(each("saturation").mean()),
        torque_violations=int(each("torque_violations").sum()),
        velocity_violations=int(each("velocity_violations").sum()),
        position_violations=int(each("position_violations").sum()),
        step_time_p50=float(p50),
        step_time_p99=float(p99),
    )

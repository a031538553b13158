"""What one control step costs, from a state to a torque, in closed loop."""

from __future__ import annotations

from arm3dof import MpcSettings, load_robot, summarise
from arm3dof.runtime.experiment import default_start, default_target, simulate
from benchmarks.tables import Table

ROBOTS = ("arm3dof", "ur5", "panda")
HORIZONS = (10, 20, 40)


def run(*, quick: bool) -> Table:
    """Time every step of a motion under the default settings."""
    rows = []
    for name in ROBOTS:
        robot = load_robot(name)
        start = default_start(robot)
        target = default_target(robot, start)
        for horizon in HORIZONS:
            settings = MpcSettings(horizon=horizon)
            duration = 0.5 if quick else 6.0
            metrics = summarise(
                simulate(robot, start, target, settings=settings, duration=duration)
            )
            times = (metrics.step_time_p50, metrics.step_time_p99, metrics.step_time_max)
            rows.append(
                (name, str(robot.nv), str(horizon), *(f"{1e6 * value:.0f}" for value in times))
            )
    return Table(
        "Control step",
        ("robot", "joints", "horizon", "p50 [us]", "p99 [us]", "max [us]"),
        rows,
        "One whole MpcController.step from Python, torque, velocity and joint limits on.",
    )

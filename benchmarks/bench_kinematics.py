"""How fast points become joint angles: in batch, beside bare numpy, and one by one."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from arm3dof import DhGeometry, inverse_kinematics, load_robot
from arm3dof.model.planar_ik import CHUNK, solve_points
from benchmarks.tables import Table

ROBOTS = ("arm3dof", "ur5", "panda", "z1", "so100", "so101", "xarm7")


def run(*, quick: bool) -> Table:
    """Time the batch solver and its four atan2 and three square roots, in turns; then calls."""
    rng = np.random.default_rng(0)
    geometry = DhGeometry.from_robot(load_robot())
    count = 50_000 if quick else 1_000_000
    points = geometry.tool_position(rng.uniform(-np.pi, np.pi, (count, 3)))
    buffer = np.empty(CHUNK)
    numbers = rng.uniform(0.1, 1.0, CHUNK)

    def bare() -> None:
        for _ in range(0, count, CHUNK):
            for _ in range(4):
                np.arctan2(numbers, numbers, out=buffer)
            for _ in range(3):
                np.sqrt(numbers, out=buffer)

    ours, least = [], []
    for _ in range(3 if quick else 15):
        ours.append(_seconds(lambda: solve_points(geometry, points)))
        least.append(_seconds(bare))
    batch, floor = count / statistics.median(ours), count / statistics.median(least)
    rows = [
        ("batch, all four branches", f"{batch:,.0f}", f"{1e6 / batch:.3g}", f"{floor / batch:.1f}"),
        ("4 arctan2 + 3 sqrt in numpy", f"{floor:,.0f}", f"{1e6 / floor:.3g}", "1.0"),
    ]
    for name in ROBOTS:
        robot = load_robot(name)
        targets = [
            robot.placement(robot.random_configuration(rng)).translation
            for _ in range(5 if quick else 50)
        ]
        inverse_kinematics(robot, targets[0])  # SciPy's import is not the solver's time
        each = statistics.median(
            _seconds(lambda p=p, robot=robot: inverse_kinematics(robot, p)) for p in targets
        )
        rows.append((f"one call, {name}", f"{1 / each:,.0f}", f"{1e6 * each:,.0f}", ""))
    return Table(
        "Inverse kinematics",
        ("what", "points a second", "median [us]", "time ratio"),
        rows,
        f"{count:,} points in batch on one core; the bare numpy calls are timed in turns with it. "
        "One call ranks the solutions and judges limits and singularities; robots other than "
        "arm3dof are solved by search.",
    )


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start

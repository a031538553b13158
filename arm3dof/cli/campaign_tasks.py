"""``arm3dof campaign grasp`` and ``sort``: tasks in the physics world, judged on the objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console

from arm3dof.cli.campaign import OUT, Folder, Only, Seed, Trials, finish, run
from arm3dof.cli.compare import Workers
from arm3dof.cli.options import JsonFlag
from arm3dof.runtime.campaign import Campaign

if TYPE_CHECKING:  # MuJoCo loads only where a world is simulated
    from arm3dof.runtime.tasks.simulated import Faults

GRASP_GOAL, GRASP_GOAL_FAULTS, SORT_GOAL = 0.99, 0.95, 0.98
WithFaults = Annotated[
    bool,
    typer.Option(
        "--faults",
        help="Servos with friction, 1 degree of backlash and noisy encoders, a camera that is "
        "30 ms late, and masses up to 20 % wrong; the task is told of none.",
    ),
]


def grasp(
    n: Trials = 200,
    seed: Seed = 0,
    faults: WithFaults = False,
    only: Only = None,
    workers: Workers = None,
    folder: Folder = OUT,
    as_json: JsonFlag = False,
) -> int:
    """Grasp random objects, and count how often they are lifted 5 cm and placed within 1 cm.

    Objects of 2 to 4 cm and 10 to 60 g, of any colour, shape and light, anywhere in the graspable
    region. What counts is the object itself in the physics; every failure has its reason. The
    answer is no when fewer than 99 % succeed, or 95 % with --faults.
    """
    from arm3dof.runtime.tasks.grasp_trial import GraspTrial

    trial = GraspTrial(faults_of(faults))
    done = run("grasp", trial, n, seed, only=only, workers=workers, folder=folder)
    goal = GRASP_GOAL_FAULTS if faults else GRASP_GOAL
    miss = 1000 * done.column("place_error_m")
    report: dict[str, Any] = done.report() | {
        "faults": faults,
        "goal": goal,
        "place_error_mm": _spread(miss),
        "lift_mm": _spread(1000 * done.column("lift_m")),
        "duration_s": _spread(done.column("duration_s")),
    }

    def show(console: Console) -> None:
        if miss.size:
            p50, p95 = np.percentile(miss, [50, 95])
            console.print(
                f"placed {p50:.1f} mm off at the median, {p95:.1f} mm at the 95th percentile"
            )

    return finish(done, report, as_json=as_json, yes=_reaches(done, goal), details=show)


def sort(
    n: Trials = 20,
    seed: Seed = 0,
    faults: WithFaults = False,
    only: Only = None,
    workers: Workers = None,
    folder: Folder = OUT,
    as_json: JsonFlag = False,
) -> int:
    """Sort random tables of nine objects, and count how many end in the bin of their colour.

    The answer is no when fewer than 98 % of the objects do, or one falls off the table.
    """
    from arm3dof.runtime.tasks.sort_trial import SortTrial

    done = run("sort", SortTrial(faults_of(faults)), n, seed, only=only, workers=workers,
               folder=folder)  # fmt: skip
    objects, right = done.column("objects_in_all").sum(), done.column("objects_sorted").sum()
    fallen = int(done.column("objects_fallen").sum())
    share = float(right / objects) if objects else 0.0
    report: dict[str, Any] = done.report() | {
        "faults": faults,
        "goal": SORT_GOAL,
        "objects": int(objects),
        "sorted": int(right),
        "sorted_rate": share,
        "fallen": fallen,
        "duration_s": _spread(done.column("duration_s")),
    }

    def show(console: Console) -> None:
        console.print(
            f"[bold]{int(right)} of {int(objects)}[/] objects ({100 * share:.1f} %) are in the "
            f"right bin; {fallen} fell off the table"
        )

    yes = share >= SORT_GOAL and fallen == 0
    return finish(done, report, as_json=as_json, yes=yes, details=show)


def faults_of(wanted: bool) -> Faults | None:
    """Return the faults of ``--faults``; None without it."""
    from arm3dof.runtime.tasks.simulated import Faults

    return Faults() if wanted else None


def _reaches(done: Campaign, goal: float) -> bool:
    return done.success_rate >= goal


def _spread(values: np.ndarray) -> dict[str, float] | None:
    """Return median, 95th percentile and largest; None of nothing."""
    if not values.size:
        return None
    p50, p95 = np.percentile(values, [50, 95])
    return {"p50": float(p50), "p95": float(p95), "max": float(values.max())}

"""``arm3dof compare``: MPC and classical controllers on the same moves and disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.options import (
    JsonFlag,
    OutFolder,
    Overrides,
    RobotName,
    ServoNames,
    robot_from,
    writable,
)
from arm3dof.cli.progress import counted
from arm3dof.cli.simulate import show_files
from arm3dof.files import write_atomically
from arm3dof.runtime.compare import ENTRANTS, Comparison, Row, compare
from arm3dof.runtime.parallel import core_count
from arm3dof.runtime.scenarios import scenario_set
from arm3dof.ui.summary import to_json

Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        min=1,
        help="Processes that share the runs. Default: one a core.",
        show_default=False,
    ),
]


def compare_controllers(
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    scenarios: Annotated[
        str,
        typer.Option(metavar="SET", help="quick: the paper's move and 3 others; full: 15 others."),
    ] = "quick",
    controllers: Annotated[
        list[str] | None,
        typer.Option(
            "--controller",
            metavar="NAME",
            help=f"One of {', '.join(ENTRANTS)}. Repeatable. Default: all.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Seed of the moves and disturbances.")
    ] = 0,
    workers: Workers = None,
    folder: OutFolder = None,
    as_json: JsonFlag = False,
) -> int:
    """Compare MPC with classical controllers on the same moves and disturbances.

    Each move is made five times: with nothing wrong, with a payload of 0.1 kg, with masses up to
    30 % wrong, with a push of 10 degrees, and with encoder noise of 0.1 degrees. No controller is
    told. With --out it writes the table (compare.json) and a figure (compare.png).
    """
    arm = robot_from(robot, changes, servos)
    chosen = scenario_set(arm, scenarios, seed)
    if folder is not None:
        writable(folder)
    with counted("comparing", "runs") as progress:
        comparison = compare(
            arm, chosen, controllers, workers=workers or core_count(), progress=progress
        )
    report = _report(comparison)
    files = []
    if folder is not None:
        from arm3dof.ui.compare_plots import plot_comparison  # matplotlib loads only to draw
        from arm3dof.ui.plots import png

        files = [folder / "compare.png", folder / "compare.json"]
        write_atomically(files[0], png(plot_comparison(comparison)))
        write_atomically(files[1], to_json(report).encode())
    report["files"] = [str(file) for file in files]

    def show(console: Console) -> None:
        console.print(_main_table(comparison.table()))
        console.print()
        console.print(_condition_table(comparison))
        show_files(console, files)

    return output.deliver(report, as_json=as_json, show=show)


def _report(comparison: Comparison) -> dict[str, object]:
    rows = [*comparison.table()]
    for condition in comparison.conditions:
        rows += comparison.table(condition)
    gains = {
        name: {"Kp": found.position, "Kd": found.velocity, "Ki": found.integral}
        for name, found in comparison.gains.items()
    }
    return {"rows": [_with_units(row) for row in rows], "gains": gains}


def _with_units(row: Row) -> dict[str, object]:
    return {name + _UNITS.get(name, ""): value for name, value in asdict(row).items()}


_UNITS = {
    "rms_error": "_rad",
    "final_error": "_rad",
    "worst_final_error": "_rad",
    "overshoot": "_rad",
    "settling_time": "_s",
    "energy": "_j",
    "torque_squared": "_n2m2s",
    "step_time_p50": "_s",
    "step_time_p99": "_s",
}


def _main_table(rows: Sequence[Row]) -> object:
    table = output.table(
        "controller",
        "RMS error [deg]",
        "final, median [deg]",
        "final, worst [deg]",
        "settled [%]",
        "settling [s]",
        "overshoot [deg]",
        "energy [J]",
        "torque² [N²m²s]",
        "saturated [%]",
        "violations [steps]",
        "step p50 [us]",
        "p99 [us]",
    )
    for row in rows:
        violations = (row.torque_violations, row.velocity_violations, row.position_violations)
        table.add_row(
            ENTRANTS[row.controller].label,
            f"{np.rad2deg(row.rms_error):.2f}",
            f"{np.rad2deg(row.final_error):.3f}",
            f"{np.rad2deg(row.worst_final_error):.3f}",
            f"{100 * row.settled:.0f}",
            "-" if row.settling_time is None else f"{row.settling_time:.2f}",
            f"{np.rad2deg(row.overshoot):.2f}",
            f"{row.energy:.3f}",
            f"{row.torque_squared:.3f}",
            f"{100 * row.saturation:.1f}",
            " ".join(f"{kind}{count}" for kind, count in zip("τvq", violations, strict=True)),
            f"{1e6 * row.step_time_p50:.0f}",
            f"{1e6 * row.step_time_p99:.0f}",
        )
    return table


def _condition_table(comparison: Comparison) -> object:
    columns = [f"{condition} [deg]" for condition in comparison.conditions]
    table = output.table("RMS error / worst final", *columns)
    by_condition = [comparison.table(condition) for condition in comparison.conditions]
    for rows in zip(*by_condition, strict=True):
        cells = [
            f"{np.rad2deg(row.rms_error):.2f} / {np.rad2deg(row.worst_final_error):.2f}"
            for row in rows
        ]
        table.add_row(ENTRANTS[rows[0].controller].label, *cells)
    return table

"""``arm3dof sweep``: what the weights and other settings of MPC do to tracking and energy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from arm3dof.cli import output
from arm3dof.cli.compare import Workers
from arm3dof.cli.options import JsonFlag, Overrides, RobotName, ServoNames, robot_from, writable
from arm3dof.cli.progress import counted
from arm3dof.cli.simulate import show_files
from arm3dof.control.settings import MpcSettings
from arm3dof.files import write_atomically
from arm3dof.runtime.parallel import core_count
from arm3dof.runtime.sweep import KNOBS, Sweep, Vary, default_points, points, sweep, with_value


def sweep_settings(
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="LOW:HIGH:COUNT, evenly on a log scale, or A,B,C. Once, or twice for a grid. "
            f"Names: {', '.join(KNOBS)}. Default: the paper's Q, R and P in turn.",
            show_default=False,
        ),
    ] = None,
    formulation: Annotated[
        str, typer.Option(metavar="NAME", help="Formulation of every run that does not vary it.")
    ] = MpcSettings.formulation,
    workers: Workers = None,
    folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write into.")
    ] = Path("out/sweep"),
    as_json: JsonFlag = False,
) -> int:
    """Repeat the paper's experiment with other settings and draw tracking against energy.

    Writes sweep.csv and sweep.png. A run whose result sweep.csv holds already is not made again,
    so that a sweep that was stopped goes on where it was, and one that was widened makes only the
    new runs.
    """
    arm = robot_from(robot, changes, servos)
    base = with_value(MpcSettings(), "formulation", formulation)
    chosen = default_points(base)
    if vary:
        chosen = points([Vary.parse(text) for text in vary], base)
    writable(folder)
    table = folder / "sweep.csv"
    with counted("sweeping", "runs") as progress:
        result = sweep(arm, chosen, table=table, workers=workers or core_count(), progress=progress)

    from arm3dof.ui.plots import png  # matplotlib loads only to draw
    from arm3dof.ui.sweep_plot import plot_sweep

    figure = folder / "sweep.png"
    write_atomically(figure, png(plot_sweep(result)))
    files = [table, figure]

    def show(console: Console) -> None:
        console.print(_table(result))
        console.print(f"  [dim]reused[/]        {result.reused} of {len(result.outcomes)} runs")
        show_files(console, files)

    report = _report(result) | {"files": [str(file) for file in files]}
    return output.deliver(report, as_json=as_json, show=show)


def _report(result: Sweep) -> dict[str, Any]:
    return {
        "points": [
            {
                "family": outcome.point.family,
                "value": outcome.point.label,
                **outcome.values,
                "on_front": bool(on_front),
            }
            for outcome, on_front in zip(result.outcomes, result.front(), strict=True)
        ],
        "reused": result.reused,
    }


def _table(result: Sweep) -> Table:
    table = output.table(
        "varied",
        "value",
        "RMS error [deg]",
        "settling [s]",
        "final error [deg]",
        "energy [J]",
        "torque² [N²m²s]",
        "saturated [%]",
        "best compromise",
    )
    for outcome, on_front in zip(result.outcomes, result.front(), strict=True):
        values = {
            name: np.nan if value is None else value for name, value in outcome.values.items()
        }
        settling = values["settling_time_s"]
        table.add_row(
            outcome.point.family,
            outcome.point.label,
            f"{np.rad2deg(values['rms_error_rad']):.2f}",
            f"{settling:.2f}" if np.isfinite(settling) else "-",
            f"{np.rad2deg(values['final_error_rad']):.3f}",
            f"{values['energy_j']:.3f}",
            f"{values['torque_squared_n2m2s']:.3f}",
            f"{100 * values['saturation']:.1f}",
            "yes" if on_front else "",
        )
    return table

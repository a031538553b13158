"""``arm3dof simulate``: drive a robot to a target under MPC, in simulation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output
from arm3dof.cli.disturb import (
    DelayMs,
    Disturbances,
    Engine,
    ModelError,
    NoiseDeg,
    PayloadKg,
    PlantName,
    Pushes,
    Seed,
    Wrenches,
)
from arm3dof.cli.options import (
    JsonFlag,
    OutFolder,
    Overrides,
    RobotName,
    ServoNames,
    numbers,
    robot_from,
    writable,
)
from arm3dof.cli.progress import control_steps
from arm3dof.cli.robots import show_reach
from arm3dof.cli.units import read_configuration
from arm3dof.control.settings import Formulation, MpcSettings
from arm3dof.errors import InputError
from arm3dof.files import write_atomically
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.reach import Reach
from arm3dof.model.robot import Robot
from arm3dof.runtime import experiment
from arm3dof.runtime.metrics import Metrics, summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from arm3dof.ui.summary import run_report, to_json


def simulate(
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    start_deg: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,C",
            help="Start angles. Default: 0, or mid-range where a joint cannot be at 0.",
            show_default=False,
        ),
    ] = None,
    target_deg: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,C",
            help="Target angles. Default: the paper's 28.1,67.8,53.8; "
            "30 degrees a joint for a robot that does not have three.",
            show_default=False,
        ),
    ] = None,
    target_m: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Target point of the tool in the base frame, instead of angles.",
            show_default=False,
        ),
    ] = None,
    formulation: Annotated[
        Formulation, typer.Option(help="What the MPC decides, and on which model.")
    ] = MpcSettings.formulation,
    horizon: Annotated[int, typer.Option(metavar="N", help="Stages that the MPC plans.")] = 20,
    dt: Annotated[float, typer.Option(metavar="T", help="Sampling time in seconds.")] = 0.05,
    duration: Annotated[
        float, typer.Option(metavar="S", help="Simulated seconds.")
    ] = experiment.PAPER_DURATION,
    plant: PlantName = Engine.PINOCCHIO,
    payload_kg: PayloadKg = 0.0,
    pushes: Pushes = None,
    wrenches: Wrenches = None,
    model_error: ModelError = 0.0,
    noise_deg: NoiseDeg = 0.0,
    delay_ms: DelayMs = 0.0,
    seed: Seed = 0,
    folder: OutFolder = None,
    as_json: JsonFlag = False,
) -> int:
    """Drive a robot to a target under model predictive control, in simulation.

    Without options this is the paper's experiment, and with --formulation paper it is the paper's
    controller too. The controller is told of no payload, push,
    wrench, model error, noise or delay: they befall the simulated arm alone. With --out it writes
    the recording (run.npz), the paper's four figures and summary.json. The answer is no when the
    arm does not settle.
    """
    arm = robot_from(robot, changes, servos)
    settings = MpcSettings(formulation=formulation, horizon=horizon, dt=dt)
    start = experiment.default_start(arm)
    if start_deg is not None:
        start = read_configuration(arm, start_deg, "--start-deg")
    target = _target(arm, start, target_deg, target_m)
    if isinstance(target, Reach):
        return _out_of_reach(arm, target, as_json)
    disturbances = Disturbances(
        payload_kg, pushes or (), wrenches or (), model_error, noise_deg, delay_ms, seed
    )
    make_plant = disturbances.plant_of(arm, duration, plant)
    if folder is not None:
        writable(folder)
    with control_steps("simulating", duration, dt) as observer:
        recording = experiment.simulate(
            arm,
            start,
            target,
            settings=settings,
            duration=duration,
            observers=[observer],
            notes=disturbances.notes() | plant.note(),
            make_plant=make_plant,
        )
    metrics = summarise(recording)
    files = [] if folder is None else write_run(recording, metrics, folder)

    def show(console: Console) -> None:
        show_metrics(console, metrics)
        show_files(console, files)

    report = run_report(metrics, files)
    return output.deliver(report, as_json=as_json, show=show, yes=metrics.settled)


def _target(
    robot: Robot, start: Array, target_deg: str | None, target_m: str | None
) -> Array | Reach:
    """Return the joint target, or the answer of inverse kinematics when there is none."""
    if target_deg is not None and target_m is not None:
        raise InputError("--target-deg and --target-m are both given; give one of them")
    if target_deg is not None:
        return read_configuration(robot, target_deg, "--target-deg")
    if target_m is None:
        return experiment.default_target(robot, start)
    reach = inverse_kinematics(robot, numbers(target_m, 3, "--target-m"), near=start)
    return reach if reach.best is None else reach.best


def _out_of_reach(robot: Robot, reach: Reach, as_json: bool) -> int:
    report = run_report(None, []) | {
        "reason": reach.reason,
        "distance_m": reach.distance,
        "nearest_m": reach.nearest,
        "joint": reach.joint,
    }

    def show(console: Console) -> None:
        show_reach(console, robot, reach)

    return output.deliver(report, as_json=as_json, show=show, yes=False)


def write_run(recording: Recording, metrics: Metrics, folder: Path) -> list[Path]:
    """Write a run's recording, figures and summary, and return the files.

    Raises:
        InputError: the folder cannot be written.
    """
    from arm3dof.ui.plots import save_figures  # matplotlib loads only where it draws

    run, summary = folder / "run.npz", folder / "summary.json"
    files = [recording.save(run), *save_figures(recording, folder), summary]
    write_atomically(summary, to_json(run_report(metrics, files)).encode())
    return files


def show_metrics(console: Console, metrics: Metrics) -> None:
    """Print what a run achieved for people."""
    if metrics.settled:
        console.print(f"[green]settled[/] in {metrics.settling_time:.2f} s")
    else:
        console.print("[red]not settled[/] at the end of the run")
    violations = metrics.torque_violations
    broken = f", [red]exceeded in {violations} steps[/]" if violations else ""
    status = ", ".join(f"{count} {name}" for name, count in metrics.status_counts.items())
    rows = {
        "final error": f"{np.rad2deg(metrics.final_error):.3f} deg",
        "peak torque": f"{metrics.peak_torque:.2f} of {metrics.torque_limit:.2f} N m{broken}",
        "energy": f"{metrics.energy:.2f} J",
        "control step": f"{metrics.step_time_p50 * 1e6:.0f} us median, "
        f"{metrics.step_time_p99 * 1e6:.0f} us in 99 of 100",
        "steps": status,
    }
    for name, value in rows.items():
        console.print(f"  [dim]{name:13}[/] {value}")


def show_files(console: Console, files: Sequence[Path]) -> None:
    """Print which files were written, folder by folder."""
    for folder in dict.fromkeys(file.parent for file in files):
        names = ", ".join(file.name for file in files if file.parent == folder)
        console.print(f"  [dim]{'wrote':13}[/] {escape(str(folder))}: {escape(names)}")

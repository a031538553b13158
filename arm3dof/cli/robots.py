"""``arm3dof robots``, ``check`` and ``ik``: which robots, are they sound, what they reach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output
from arm3dof.cli.options import (
    JsonFlag,
    Overrides,
    RobotName,
    ServoNames,
    number,
    read_servos,
    robot_from,
)
from arm3dof.cli.units import to_degrees, unit
from arm3dof.errors import Problem, RobotError
from arm3dof.model.agreement import Agreement, closed_form_agreement
from arm3dof.model.dh import fit_dh
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.library import RobotEntry, known_servo, list_robots, problems_of
from arm3dof.model.reach import Reach
from arm3dof.model.robot import Robot
from arm3dof.model.servos import effort_warnings

_AGREES = 1e-9  # [SI units]: round-off on arms of a few metres and kilograms is far below


def robots(as_json: JsonFlag = False) -> int:
    """List the robots that can be loaded by name."""
    entries = list_robots()

    def show(console: Console) -> None:
        listing = output.table("robot", "joints", "tool frame", "note")
        for entry in entries:
            note = entry.note if entry.installed else "not installed: pip install 'arm3dof[robots]'"
            listing.add_row(entry.name, str(entry.joints), entry.tool_frame, escape(note))
        console.print(listing)
        console.print("Any URDF file can be loaded by its path.", style="dim")

    return output.deliver({"robots": [_entry(it) for it in entries]}, as_json=as_json, show=show)


def check(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot's name or a URDF file.")],
    changes: Overrides = None,
    servos: ServoNames = None,
    as_json: JsonFlag = False,
) -> int:
    """Say whether a robot is sound, and whether the paper's closed form gives its dynamics.

    The closed form of M, C v and g is compared with Pinocchio over 1000 random states. A joint
    whose effort in the file exceeds its servo's torque by over 20 % is worth a warning: the servo
    is that of --servos, else the one that the robot is known to be built with. The answer is no
    when there is a problem.
    """
    found: tuple[Problem, ...] = problems_of(robot)
    warnings: tuple[Problem, ...] = ()
    arm: Robot | None = None
    if not found:
        try:
            warnings = _warnings(robot, changes, servos)
            arm = robot_from(robot, changes, servos)
        except RobotError as error:
            found = error.problems
    misfit, agreement = _closed_form(arm)
    sound = not found and (agreement is None or max(agreement) < _AGREES)
    report = {
        "ok": sound,
        "problems": _as_names(found),
        "warnings": _as_names(warnings),
        "closed_form": {
            "applies": agreement is not None,
            "max_error": None if agreement is None else agreement._asdict(),
        },
    }

    def show(console: Console) -> None:
        if arm is not None:
            _show_robot(console, arm)
        for problem in found:
            console.print(f"[red]no[/]  {escape(problem.where)}: {escape(problem.what)}")
            console.print(f"    -> {escape(problem.cure)}")
        for warning in warnings:
            console.print(f"[yellow]warning[/]  {escape(warning.where)}: {escape(warning.what)}")
            console.print(f"    -> {escape(warning.cure)}")
        if agreement is not None:
            console.print(
                "The paper's closed form applies; over 1000 states it differs from Pinocchio by "
                f"M {agreement.M:.1e} kg m², C v {agreement.C:.1e} N m, g {agreement.g:.1e} N m"
            )
        elif misfit is not None:
            console.print(f"The paper's closed form does not apply: {escape(str(misfit))}")
        console.print("[green]sound[/]" if sound else "[red]not sound[/]")

    return output.deliver(report, as_json=as_json, show=show, yes=sound)


def ik(
    x: Annotated[str, typer.Argument(metavar="X", help="Forward, in metres.")],
    y: Annotated[str, typer.Argument(metavar="Y", help="To the left, in metres.")],
    z: Annotated[str, typer.Argument(metavar="Z", help="Up, in metres.")],
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    as_json: JsonFlag = False,
) -> int:
    """Find the joint angles that bring the tool to a point of the base frame.

    The answer is no when the robot cannot reach it inside its joint limits.
    """
    point = [number(text, name) for name, text in (("X", x), ("Y", y), ("Z", z))]
    arm = robot_from(robot, changes, servos)
    reach = inverse_kinematics(arm, point)

    def show(console: Console) -> None:
        show_reach(console, arm, reach)

    return output.deliver(reach_report(arm, reach), as_json=as_json, show=show, yes=reach.reachable)


def reach_report(robot: Robot, reach: Reach) -> dict[str, object]:
    """Return the answer of inverse kinematics with the unit in every name."""
    return {
        "reachable": reach.reachable,
        "solutions_deg": to_degrees(robot, reach.solutions),
        "branches": reach.branches,
        "within_limits": reach.within_limits,
        "reason": reach.reason,
        "distance_m": reach.distance,
        "nearest_m": reach.nearest,
        "joint": reach.joint,
    }


def show_reach(console: Console, robot: Robot, reach: Reach) -> None:
    """Print the answer of inverse kinematics for people."""
    if len(reach.branches):
        angles = output.table("branch", *_headings(robot), "limits")
        rows = zip(reach.branches, reach.solutions, reach.within_limits, strict=True)
        for branch, q, inside in rows:
            verdict = "[green]inside[/]" if inside else "[red]outside[/]"
            angles.add_row(branch, *(f"{angle:.2f}" for angle in to_degrees(robot, q)), verdict)
        console.print(angles)
    for singularity in reach.singularities:
        console.print(f"{singularity.sentence}", style="yellow")
    console.print(reach.sentence, style="green" if reach.reachable else "red", markup=False)


def _headings(robot: Robot) -> list[str]:
    return [f"{name} [{unit(robot, joint)}]" for joint, name in enumerate(robot.joint_names)]


def _warnings(
    source: str, changes: list[str] | None, servos: list[str] | None
) -> tuple[Problem, ...]:
    """Compare the efforts of the file, with the changes of --set, with what the servos give."""
    driven_by = read_servos(servos) or known_servo(source)
    return () if driven_by is None else effort_warnings(robot_from(source, changes), driven_by)


def _as_names(problems: Sequence[Problem]) -> list[dict[str, str]]:
    return [{"where": it.where, "what": it.what, "cure": it.cure} for it in problems]


def _closed_form(robot: Robot | None) -> tuple[Problem | None, Agreement | None]:
    if robot is None:
        return None, None
    fit = fit_dh(robot)
    if isinstance(fit, Problem):
        return fit, None
    return None, closed_form_agreement(robot, np.random.default_rng(0))


def _entry(entry: RobotEntry) -> dict[str, object]:
    return {
        "name": entry.name,
        "source": entry.source,
        "installed": entry.installed,
        "joints": entry.joints,
        "tool_frame": entry.tool_frame,
        "note": entry.note,
    }


def _show_robot(console: Console, robot: Robot) -> None:
    limits, units = robot.limits, sorted({unit(robot, joint) for joint in range(robot.nv)})
    angle = " or ".join(units)
    console.print(f"{robot.name}: {robot.nv} joints, tool frame {robot.tool_frame}", markup=False)
    listing = output.table(
        "joint",
        f"from [{angle}]",
        f"to [{angle}]",
        f"speed [{angle}/s]",
        "torque [N m]",
        "damping [N m s/rad]",
    )
    columns = zip(
        robot.joint_names,
        to_degrees(robot, limits.q_min),
        to_degrees(robot, limits.q_max),
        to_degrees(robot, limits.v_max),
        limits.tau_max,
        robot.damping,
        strict=True,
    )
    for name, *values in columns:
        listing.add_row(name, *(f"{value:.4g}" for value in values))
    console.print(listing)

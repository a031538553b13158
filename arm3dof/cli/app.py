"""The ``arm3dof`` program: its commands, and how it ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from typing import Annotated

import typer

from arm3dof.cli import (
    calibrate,
    campaign,
    campaign_tasks,
    compare,
    demo,
    doctor,
    output,
    report,
    robots,
    see,
    simulate,
    studio,
    sweep,
    tasks,
    view,
)
from arm3dof.cli.options import JsonFlag
from arm3dof.errors import ArmError

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def root(
    context: typer.Context,
    show_version: Annotated[
        bool, typer.Option("--version", help="Print the version.", show_default=False)
    ] = False,
) -> None:
    """From a picture to a motion: see an object, aim, and move a robot arm there with MPC.

    Exit codes: 0 done, 1 the answer is no, 2 bad input. Lengths are metres and angles degrees,
    as each option's name says.
    """
    if show_version:
        output.out().print(f"arm3dof {version('arm3dof')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        output.out().print(context.get_help(), end="")


_command = cache(typer.main.get_command)  # all the options take it a while
_POINT = {"ignore_unknown_options": True}  # a negative coordinate is no option
app.command()(demo.demo)
app.command()(tasks.sort)
app.command()(see.see)
app.command(context_settings=_POINT)(robots.ik)
app.command()(simulate.simulate)
app.command("compare")(compare.compare_controllers)
app.command("sweep")(sweep.sweep_settings)
app.command()(view.view)
app.command()(studio.studio)
app.command("report")(report.report_run)
app.command()(robots.check)
app.command("robots")(robots.robots)
app.add_typer(calibrate.calibrate, name="calibrate")
campaign.campaign.command()(campaign_tasks.grasp)
campaign.campaign.command()(campaign_tasks.sort)
app.add_typer(campaign.campaign, name="campaign")


@app.command("doctor")
def examine(as_json: JsonFlag = False) -> int:
    """Say whether this installation is sound, and what to do when it is not."""
    return doctor.report(as_json=as_json)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code.

    Args:
        arguments: the words after the program's name; those of this process when ``None``.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _command(app).main(words, prog_name="arm3dof", standalone_mode=False)
    except (ArmError, typer.TyperException) as error:
        return _refuse(error.format_message() if isinstance(error, typer.TyperException) else error)
    except OSError as error:
        return _refuse(f"{error.filename or 'system'}: {error.strerror or error}")
    if code == output.INTERRUPTED:  # typer has caught Ctrl-C
        output.err().print("stopped")
    return int(code or output.DONE)


def _refuse(reason: object) -> int:
    line = " ".join(str(reason).split())
    output.err().print(f"error: {line}", markup=False)
    return output.BAD_INPUT

"""``arm3dof sort``, and the demonstration in the physics world."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn

from arm3dof.cli import output
from arm3dof.cli.campaign_tasks import WithFaults, faults_of
from arm3dof.cli.options import JsonFlag, Overrides, RobotName, ServoNames, robot_from, writable
from arm3dof.cli.serving import Browser, Port, show_address
from arm3dof.cli.simulate import show_files
from arm3dof.cli.view import PLAYS, play
from arm3dof.control.step import ControlStep
from arm3dof.errors import ArmError, MissingExtra
from arm3dof.model.gripper import find_gripper
from arm3dof.model.robot import Robot
from arm3dof.state import JointState

if TYPE_CHECKING:  # MuJoCo, OpenCV and matplotlib load only where a task is run
    from arm3dof.runtime.tasks.machine import Phase
    from arm3dof.ui.task_story import TaskStory, Watcher

Video = Annotated[
    bool, typer.Option("--mp4", help="Write what the camera sees as camera.mp4 (extra 'share').")
]
Serve = Annotated[bool, typer.Option(help="Play the motion on a page until Ctrl-C.")]
_COLOURS = ("green", "red", "blue", "yellow")


def why_no_physics(robot: Robot) -> str | None:
    """Return why a robot cannot grasp in the physics world on this machine; None when it can."""
    if find_gripper(robot) is None:
        return f"{robot.name} has no gripper of two sliding fingers"
    try:
        from arm3dof.sim.renderer import backend

        backend()
    except MissingExtra:
        return "MuJoCo is not installed (pip install 'arm3dof[physics]')"
    except ArmError as error:
        return str(error)
    return None


def grasp_story(
    robot: Robot, target: str | None, camera: str | None, seed: int, folder: Path, video: bool
) -> TaskStory:
    """Grasp one of three objects, and write everything into a folder.

    Raises:
        ArmError: an argument is not valid, or the folder cannot be written.
    """
    from arm3dof.config.camera_file import load_camera
    from arm3dof.runtime.tasks.goals import Grasping
    from arm3dof.runtime.tasks.grasp_trial import judge
    from arm3dof.runtime.tasks.scenes import three_objects
    from arm3dof.ui.task_story import tell_task

    setup = load_camera(camera or "front")
    known = [name for name in _COLOURS if name in setup.targets]
    task = three_objects(robot, np.random.default_rng(seed), target or known[0], known)
    with phases("grasping") as watch:
        return tell_task(
            robot,
            task.world,
            Grasping(task.target, task.place, task.body.mass),
            lambda result, verdicts: judge(task, result, verdicts[task.body.name]),
            setup.camera,
            tuple(setup.targets.values()),
            folder,
            np.random.default_rng(seed),
            video=video,
            observers=[watch],
        )


def sort(
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="What stands where.")] = 0,
    count: Annotated[
        int, typer.Option("--objects", metavar="N", min=1, max=9, help="How many stand there.")
    ] = 9,
    faults: WithFaults = False,
    robot: RobotName = "arm3dof",
    changes: Overrides = None,
    servos: ServoNames = None,
    video: Video = False,
    folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write into.")
    ] = Path("out/sort"),
    serve: Serve = True,
    port: Port = None,
    browser: Browser = True,
    as_json: JsonFlag = False,
) -> int:
    """Sort objects of three colours into three bins, in the physics world.

    The answer is no when one of them does not end in the bin of its colour.
    """
    from arm3dof.runtime.tasks.simulated import task_camera, task_targets
    from arm3dof.runtime.tasks.sort_trial import TIME_LIMIT, judge, random_table, sorting
    from arm3dof.ui.task_story import tell_task

    arm = robot_from(robot, changes, servos)
    reason = why_no_physics(arm)
    if reason is not None:
        raise ArmError(f"sorting needs the physics world: {reason}")
    writable(folder)
    rng = np.random.default_rng(seed)
    world = random_table(rng, count)
    with phases("sorting") as watch:
        story = tell_task(
            arm,
            world,
            sorting(world),
            lambda result, verdicts: judge(world, result, verdicts),
            task_camera(),
            task_targets(tuple(tray.name for tray in world.bins)),
            folder,
            rng,
            faults=faults_of(faults),
            time_limit=TIME_LIMIT,
            video=video,
            observers=[watch],
        )
    return finish_story(story, serve, port, browser, as_json=as_json)


def finish_story(
    story: TaskStory, serve: bool, port: int | None, browser: bool, *, as_json: bool
) -> int:
    """Print what came of a task, play it where that is wanted, and return the exit code."""

    def announce(url: str | None) -> None:
        def show(console: Console) -> None:
            show_story(console, story)
            if url is not None:
                show_address(console, PLAYS, url)

        output.deliver(story.report() | {"url": url}, as_json=as_json, show=show)

    if serve:
        play(story.recording, port, browser=browser, announce=announce)
    else:
        announce(None)
    return output.DONE if story.judgement.yes else output.ANSWER_IS_NO


def show_story(console: Console, story: TaskStory) -> None:
    """Print what happened in a task, step by step."""
    for step in story.result.steps:
        console.print(f"[dim]{step.t:7.2f} s[/]  [bold]{step.source:8}[/] ", end="")
        console.print(step.reason, markup=False)
    metrics = story.metrics
    if metrics.torque_violations:
        console.print(f"[red]torque limit exceeded in {metrics.torque_violations} steps[/]")
    rows = {
        "peak torque": f"{metrics.peak_torque:.2f} of {metrics.torque_limit:.2f} N m",
        "control step": f"{1e6 * metrics.step_time_p50:.0f} us median, "
        f"{1e6 * metrics.step_time_p99:.0f} us in 99 of 100",
    }
    for name, value in rows.items():
        console.print(f"  [dim]{name:13}[/] {value}")
    show_files(console, story.files)
    style = "green" if story.judgement.yes else "red"
    console.print(story.judgement.sentence, style=style, markup=False)


@contextmanager
def phases(what: str) -> Iterator[Watcher]:
    """Show what a task is doing; yields the watcher that tells."""
    console = output.err()
    columns = (TextColumn("{task.description}"), SpinnerColumn(), TextColumn("{task.fields[now]}"))
    quiet = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=quiet) as progress:
        bar = progress.add_task(what, total=None, now="")

        def watch(state: JointState, answer: ControlStep, phase: Phase) -> None:
            progress.update(bar, now=f"{state.t:.1f} s: {phase.sentence}")

        yield watch

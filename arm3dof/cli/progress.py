"""Progress bars on stderr, shown only where somebody watches a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from arm3dof.cli import output
from arm3dof.control.step import ControlStep
from arm3dof.runtime.loop import Observer
from arm3dof.state import JointState


@contextmanager
def control_steps(what: str, duration: float, dt: float) -> Iterator[Observer]:
    """Show how far a run has come; yields the observer that moves the bar.

    Args:
        what: what is being done.
        duration: length of the run [s].
        dt: time between two control steps [s].
    """
    console = output.err()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s"),
        TimeRemainingColumn(),
    )
    quiet = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=quiet) as progress:
        bar = progress.add_task(what, total=duration)

        def observe(state: JointState, answer: ControlStep) -> None:
            progress.update(bar, completed=min(state.t + dt, duration))

        yield observe


@contextmanager
def counted(what: str, things: str) -> Iterator[Callable[[int, int], None]]:
    """Show how many of some things are done; yields what moves the bar.

    Args:
        what: what is being done.
        things: what is counted, in the plural.
    """
    console = output.err()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[so_far]}"),
        TimeRemainingColumn(),
    )
    quiet = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=quiet) as progress:
        bar = progress.add_task(what, total=None, so_far="starting")

        def tell(done: int, total: int) -> None:
            so_far = f"{done} of {total} {things}"
            progress.update(bar, completed=done, total=total, so_far=so_far)

        yield tell

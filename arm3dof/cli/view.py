"""``arm3dof view``: the page that plays a recording, until Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag
from arm3dof.cli.serving import Browser, Port, serve_until_interrupted, show_address
from arm3dof.cli.simulate import show_metrics
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording

PLAYS = "The motion plays"


def view(
    run: Annotated[Path, typer.Argument(metavar="RUN.npz", help="A recording.")],
    port: Port = None,
    browser: Browser = True,
    as_json: JsonFlag = False,
) -> int:
    """Play a recording in 3-D on a page of this machine, until Ctrl-C.

    With --json the object is printed when the page is ready.
    """
    recording = Recording.load(run)
    metrics = summarise(recording)

    def announce(url: str) -> None:
        def show(console: Console) -> None:
            show_metrics(console, metrics)
            show_address(console, PLAYS, url)

        output.deliver({"url": url, "settled": metrics.settled}, as_json=as_json, show=show)

    play(recording, port, browser=browser, announce=announce)
    return output.DONE


def play(
    recording: Recording, port: int | None, *, browser: bool, announce: Callable[[str], None]
) -> None:
    """Serve a page that plays a recording until Ctrl-C.

    Args:
        recording: the run.
        port: port of the page; ``None`` takes the usual one, or any when it is taken.
        browser: open the page in a browser when there is a desktop.
        announce: called with the page's address once it answers.

    Raises:
        InputError: the port is taken, or cannot be used.
    """
    from arm3dof.ui.meshcat_scene import recording_scene
    from arm3dof.ui.server import serve

    window = recording_scene(recording).window
    serve_until_interrupted(partial(serve, window), port, browser=browser, announce=announce)

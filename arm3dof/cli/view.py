"""``arm3dof view``: a recording in the browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.doctor import VIEWER_PORT
from arm3dof.cli.options import JsonFlag
from arm3dof.cli.simulate import show_metrics
from arm3dof.errors import InputError
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording

if TYPE_CHECKING:  # the server loads only where something is shown
    from arm3dof.ui.server import LocalServer

Port = Annotated[
    int | None,
    typer.Option(
        metavar="PORT",
        help=f"Port of the page; 0 takes any. Default: {VIEWER_PORT}, or any when it is taken.",
        show_default=False,
    ),
]
Browser = Annotated[bool, typer.Option(help="Open the page in a browser when there is one.")]


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
            show_address(console, url)

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
    with _server(recording, port) as server:
        announce(server.url)
        if browser and _has_desktop():
            webbrowser.open(server.url)
        try:
            server.wait()
        except KeyboardInterrupt:
            output.err().print("stopped")


def show_address(console: Console, url: str) -> None:
    """Print where the page is."""
    console.print(f"\nThe motion plays at [bold]{url}[/] (Ctrl-C ends it)")


def _server(recording: Recording, port: int | None) -> LocalServer:
    from arm3dof.ui.meshcat_scene import recording_scene
    from arm3dof.ui.server import serve

    window = recording_scene(recording).window
    if port is not None:
        return serve(window, port)
    try:
        return serve(window, VIEWER_PORT)
    except InputError:  # taken: any other will do
        return serve(window, 0)


def _has_desktop() -> bool:
    """Return whether somebody sits at this terminal with a graphical desktop around it."""
    graphical = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    return graphical and sys.stdout.isatty()

"""Serving a page of this machine from the command line, until Ctrl-C."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.doctor import VIEWER_PORT
from arm3dof.errors import InputError

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


def serve_until_interrupted(
    make: Callable[[int], LocalServer],
    port: int | None,
    *,
    browser: bool,
    announce: Callable[[str], None],
) -> None:
    """Serve a page until Ctrl-C.

    Args:
        make: makes the server on a port.
        port: port of the page; ``None`` takes the usual one, or any when it is taken.
        browser: open the page in a browser when there is a desktop.
        announce: called with the page's address once it answers.

    Raises:
        InputError: the port is taken, or cannot be used.
    """
    with _on_port(make, port) as server:
        announce(server.url)
        if browser and _has_desktop():
            webbrowser.open(server.url)
        try:
            server.wait()
        except KeyboardInterrupt:
            output.err().print("stopped")


def show_address(console: Console, what: str, url: str) -> None:
    """Print where the page is.

    Args:
        console: where to.
        what: what is to be seen there, as the beginning of a sentence.
        url: its address.
    """
    console.print(f"\n{what} at [bold]{url}[/] (Ctrl-C ends it)")


def _on_port(make: Callable[[int], LocalServer], port: int | None) -> LocalServer:
    if port is not None:
        return make(port)
    try:
        return make(VIEWER_PORT)
    except InputError:  # taken: any other will do
        return make(0)


def _has_desktop() -> bool:
    """Return whether somebody sits at this terminal with a graphical desktop around it."""
    graphical = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    return graphical and sys.stdout.isatty()

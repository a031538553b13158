"""``arm3dof report``: a recording as files that can be sent to others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag
from arm3dof.cli.simulate import show_files, show_metrics
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.ui.summary import run_report

Run = Annotated[Path, typer.Argument(metavar="RUN.npz", help="A recording.")]


def report_run(
    run: Run,
    page: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE.html",
            help="The page to write. Default: report.html beside the recording.",
            show_default=False,
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A picture to show in the page, such as seen.png.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> int:
    """Turn a recording into one page that explains the run.

    The page needs no server and no network: verdict, 3-D replay, charts that move with it, and
    settings.
    """
    from arm3dof.ui.report import write_report
    from arm3dof.ui.report_data import read_picture

    recording = Recording.load(run)
    metrics = summarise(recording)
    seen = None if picture is None else read_picture(picture)
    files = [write_report(recording, page or run.with_name("report.html"), seen)]

    def show(console: Console) -> None:
        show_metrics(console, metrics)
        show_files(console, files)

    return output.deliver(run_report(metrics, files), as_json=as_json, show=show)

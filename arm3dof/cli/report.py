"""``arm3dof report``: a recording as files that can be sent to others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output
from arm3dof.cli.options import JsonFlag
from arm3dof.cli.progress import counted
from arm3dof.cli.simulate import show_files, show_metrics
from arm3dof.errors import InputError
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
            help="The page to write. Default: report.html beside the recording, unless another "
            "kind of file is asked for.",
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
    video: Annotated[
        Path | None,
        typer.Option("--mp4", metavar="FILE", help="A video to write.", show_default=False),
    ] = None,
    stills: Annotated[
        Path | None,
        typer.Option(
            "--png",
            metavar="DIR",
            help="A folder for the figures and the first and last pose.",
            show_default=False,
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            "--mcap", metavar="FILE", help="A log to write, for Foxglove.", show_default=False
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> int:
    """Turn a recording into files that can be sent to others.

    The page needs no server and no network: verdict, 3-D replay, charts that move with it, and
    settings. No file needs a browser to be made.
    """
    recording = Recording.load(run)
    metrics = summarise(recording)
    if page is None and video is stills is log is None:
        page = run.with_name("report.html")
    if picture is not None and page is None and log is None:
        raise InputError("--picture is shown in the page or the log; give --out or --mcap too")
    files = _write(recording, page, picture, video, stills, log)

    from arm3dof.ui.replay import VERDICT

    def show(console: Console) -> None:
        show_metrics(console, metrics)
        if VERDICT in recording.notes:
            console.print(f"  [dim]{'verdict':13}[/] {escape(recording.notes[VERDICT])}")
        show_files(console, files)

    return output.deliver(run_report(metrics, files), as_json=as_json, show=show)


def _write(
    recording: Recording,
    page: Path | None,
    picture: Path | None,
    video: Path | None,
    stills: Path | None,
    log: Path | None,
) -> list[Path]:
    """Write what is asked for; what draws or logs is imported only then."""
    from arm3dof.ui.pictures import read_picture

    seen = None if picture is None else read_picture(picture)
    files: list[Path] = []
    if page is not None:
        from arm3dof.ui.report import write_report

        files.append(write_report(recording, page, seen))
    if stills is not None:
        from arm3dof.ui.plots import save_figures
        from arm3dof.ui.run_frames import save_stills

        files += [*save_figures(recording, stills), *save_stills(recording, stills)]
    if log is not None:
        from arm3dof.ui.mcap_log import write_mcap

        files.append(write_mcap(recording, log, seen))
    if video is not None:
        from arm3dof.ui.run_frames import FPS, frame_count, run_frames
        from arm3dof.ui.video import write_mp4

        total = frame_count(recording)
        with counted("drawing", "frames") as tell:
            frames = run_frames(recording)
            files.append(write_mp4(video, frames, FPS, progress=lambda done: tell(done, total)))
    return files

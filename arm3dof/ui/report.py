"""A run as one HTML file that anyone can open: the replay alone, or the whole report."""

from __future__ import annotations

from pathlib import Path

from arm3dof.files import write_atomically
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.ui.meshcat_scene import recording_scene
from arm3dof.ui.page import report_page, static_page
from arm3dof.ui.report_data import report_command


def replay_html(recording: Recording) -> str:
    """Return a page that plays a recording and needs no server and no network."""
    scene = recording_scene(recording)
    return static_page(scene.window.snapshot(), f"{scene.name} replay")


def report_html(recording: Recording, picture: bytes | None = None) -> str:
    """Return a page that explains a run: verdict, replay, charts that move with it, settings.

    Args:
        recording: the run.
        picture: a PNG, JPEG or WebP file to show, for example what the camera saw.

    Raises:
        InputError: the picture is of another kind, or too large.
    """
    scene = recording_scene(recording)
    robot, metrics = recording.load_robot(), summarise(recording)
    scene.window.post(report_command(recording, robot, metrics, picture))
    return report_page(scene.window.snapshot(), f"{scene.name} run report")


def write_replay(recording: Recording, path: str | Path) -> Path:
    """Write the page that plays a recording, whole or not at all.

    Args:
        recording: the run.
        path: the file to write.

    Returns:
        The path.

    Raises:
        InputError: the folder cannot be written.
    """
    path = Path(path)
    write_atomically(path, replay_html(recording).encode())
    return path


def write_report(recording: Recording, path: str | Path, picture: bytes | None = None) -> Path:
    """Write the page that explains a run, whole or not at all.

    Args:
        recording: the run.
        path: the file to write.
        picture: a PNG, JPEG or WebP file to show, for example what the camera saw.

    Returns:
        The path.

    Raises:
        InputError: the folder cannot be written, or the picture is of another kind or too large.
    """
    path = Path(path)
    write_atomically(path, report_html(recording, picture).encode())
    return path

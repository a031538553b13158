"""A run as one HTML file that anyone can open: the replay in 3-D and the verdict."""

from __future__ import annotations

from pathlib import Path

from arm3dof.files import write_atomically
from arm3dof.runtime.recording import Recording
from arm3dof.ui.meshcat_scene import recording_scene
from arm3dof.ui.page import static_page


def replay_html(recording: Recording) -> str:
    """Return a page that plays a recording and needs no server and no network."""
    scene = recording_scene(recording)
    return static_page(scene.window.snapshot(), f"{scene.name} replay")


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

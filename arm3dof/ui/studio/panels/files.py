"""Files: what can be kept of a run, written into the studio's folder and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from nicegui import ui

from arm3dof.errors import ArmError
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading


class Files:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab, self._studio = tab, tab.studio
        heading("Keep the last run")
        with ui.element("div").classes("line"):
            button("Recording", "save", "Write the last run as run.npz", self._recording)
            button("Report", "summarize", "Write the last run as one HTML file", self._report)
        heading("Keep the settings")
        with ui.element("div").classes("line"):
            button("TOML", "tune", "Write what is tuned as studio.toml", self._toml)
            button("Load", "folder_open", "Tune as the folder's studio.toml says", self._load)
            button("URDF", "precision_manufacturing", "Write the arm as arm.urdf", self._urdf)
        heading("Folder")
        ui.label(str(self._studio.out)).classes("path")
        self._list = ui.element("ul").classes("files")
        self._known: list[str] = []
        self.refresh()

    def refresh(self) -> None:
        """List the folder's files."""
        names = self._studio.files()
        if names == self._known:
            return
        self._known = names
        self._list.clear()
        with self._list:
            for name in names:
                with ui.element("li"):
                    ui.label(name)

    def _recording(self) -> None:
        self._write(self._studio.save_run)

    def _report(self) -> None:
        self._write(self._studio.save_report)

    def _toml(self) -> None:
        self._write(self._studio.save_settings)

    def _load(self) -> None:
        if self._tab.attempt(self._studio.load_settings):
            ui.notify("Tuned as studio.toml says", type="positive")

    def _urdf(self) -> None:
        self._write(self._studio.save_urdf)

    def _write(self, write: Callable[[], Path]) -> None:
        try:
            ui.notify(f"Wrote {write()}", type="positive")
        except ArmError as error:
            ui.notify(str(error), type="negative")
        self.refresh()

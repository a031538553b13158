"""A run in a Jupyter notebook: the page itself is the cell's output, without a server."""

from __future__ import annotations

import html
from dataclasses import dataclass

from arm3dof.errors import InputError
from arm3dof.runtime.recording import Recording


@dataclass(frozen=True)
class Embedded:
    """A page that a notebook shows when it is the last value of a cell.

    Attributes:
        page: the complete HTML page.
        height: of the frame around it [px].
        title: what a screen reader calls the frame.
    """

    page: str
    height: int
    title: str

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, kept apart from the notebook."""
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" title="{html.escape(self.title)}" '
            f'sandbox="allow-scripts" width="100%" height="{self.height}" '
            'style="border: 0; border-radius: 12px"></iframe>'
        )

    def __repr__(self) -> str:
        """Return what is shown where there is no HTML."""
        return f"{self.title} ({len(self.page) / 1e6:.1f} MB of HTML; a notebook shows it)"


def show(recording: Recording, *, charts: bool = False, height: int | None = None) -> Embedded:
    """Play a run in a notebook.

    The page is part of the notebook: it needs no server, and still plays when the notebook is
    opened elsewhere.

    Args:
        recording: the run.
        charts: whether to show the whole report, with charts that move with the arm.
        height: of the frame [px]; 560, and 900 with charts, when ``None``.

    Raises:
        InputError: the height is not positive.
    """
    from arm3dof.ui.report import replay_html, report_html  # what draws loads where it is used

    if height is not None and height <= 0:
        raise InputError(f"height is {height}; give a number of pixels above 0")
    name = recording.load_robot().name
    if charts:
        return Embedded(report_html(recording), height or 900, f"{name} run report")
    return Embedded(replay_html(recording), height or 560, f"{name} replay")

"""The panels of the page, one module each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from arm3dof.ui.studio.panels.aim import Aim
from arm3dof.ui.studio.panels.files import Files
from arm3dof.ui.studio.panels.move import Move
from arm3dof.ui.studio.panels.see import See
from arm3dof.ui.studio.panels.tune import Tune
from arm3dof.ui.studio.panels.understand import Understand
from arm3dof.ui.studio.tab import Tab


class Built(Protocol):
    """A panel of one tab."""

    def refresh(self) -> None:
        """Show what has changed, whoever changed it."""


class Panel(NamedTuple):
    """One panel.

    Attributes:
        name: its name on the page.
        icon: its symbol.
        tip: what it is for.
        build: builds it for a tab.
    """

    name: str
    icon: str
    tip: str
    build: Callable[[Tab], Built]


PANELS = (
    Panel("See", "visibility", "Choose what the camera looks for", See),
    Panel("Aim", "my_location", "Choose where the arm is to go", Aim),
    Panel("Move", "pan_tool_alt", "Push the arm, load it, open its fingers", Move),
    Panel("Tune", "tune", "Change the controller and the arm itself", Tune),
    Panel("Insight", "insights", "Understand what happens, and compare", Understand),
    Panel("Files", "folder", "Keep recordings and settings", Files),
)

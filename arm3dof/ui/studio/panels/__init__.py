"""The panels of the page, one module each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from arm3dof.ui.studio.panels import aim, move
from arm3dof.ui.studio.tab import Tab


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
    build: Callable[[Tab], None]


PANELS = (
    Panel("Aim", "my_location", "Choose where the arm is to go", aim.build),
    Panel("Move", "pan_tool_alt", "Move, push and load the arm", move.build),
)

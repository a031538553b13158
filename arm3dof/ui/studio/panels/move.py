"""Move: push the arm, load it, put it back."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from arm3dof.runtime.live import commands as cmd
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import Field, button, heading, slider

_PUSH = Field("push", "Strength", "N m", 0.1, 3.0, 0.1, "How hard the button pushes a joint")
_LOAD = Field(
    "load",
    "Payload",
    "kg",
    0.0,
    0.3,
    0.01,
    "Point mass at the tool, which the controller is not told of",
)


def build(tab: Tab) -> None:
    """Build the panel for a tab."""
    heading("Push")
    strength = slider(_PUSH, 0.8, lambda _: None)
    with ui.element("div").classes("line"):
        for joint, name in enumerate(tab.studio.robot.joint_names):
            button(
                name,
                "back_hand",
                f"Push {name} for 0.2 s, as a hand would",
                partial(_push, tab, joint, strength),
            )
    heading("Load")
    slider(_LOAD, 0.0, lambda mass: tab.ask(lambda: cmd.Load(mass)))
    heading("World")
    button(
        "Restart",
        "restart_alt",
        "Put the arm and everything on the table back to its place",
        lambda: tab.ask(cmd.Restart()),
    )


def _push(tab: Tab, joint: int, strength: ui.slider) -> None:
    tab.ask(lambda: cmd.Push(joint, float(strength.value or 0.0)))

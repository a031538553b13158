"""Move: push the arm, load it, put it back."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from arm3dof.runtime.live import commands as cmd
from arm3dof.ui.studio.fields import Field
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading, slider

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


class Move:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab = tab
        heading("Push")
        self._strength = slider(_PUSH, 0.8, lambda _: None)
        with ui.element("div").classes("line"):
            for joint, name in enumerate(tab.studio.robot.joint_names):
                tip = f"Push {name} for 0.2 s, as a hand would"
                button(name, "back_hand", tip, partial(self._push, joint))
        heading("Load")
        slider(_LOAD, 0.0, lambda mass: tab.ask(lambda: cmd.Load(mass)))
        if tab.studio.gripper is not None:
            heading("Fingers")
            opening = Field(
                "opening",
                "Opening",
                "cm",
                0.0,
                _cm(tab.studio.gripper.opening),
                0.1,
                "Distance between the fingers",
            )
            slider(opening, opening.high, lambda cm: tab.ask(lambda: cmd.Grip(0.01 * cm)))
            heading("By itself")
            with ui.element("div").classes("line"):
                button(
                    "Sort",
                    "sort",
                    "Let the arm put every object into the bin of its colour",
                    lambda: tab.ask(cmd.Do("sort")),
                )
        heading("World")
        button(
            "Restart",
            "restart_alt",
            "Put the arm and everything on the table back to its place",
            lambda: tab.ask(cmd.Restart()),
        )

    def refresh(self) -> None:
        """Do nothing: what is shown here is what was asked for."""

    def _push(self, joint: int) -> None:
        self._tab.ask(lambda: cmd.Push(joint, float(self._strength.value or 0.0)))


def _cm(metres: float) -> float:
    return round(100 * metres, 1)

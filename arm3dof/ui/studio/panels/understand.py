"""Understand: how well the arm keeps its time, what it costs, and one run against another."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading

_FACTS = (
    ("energy", "Energy", "Integral of |torque × velocity| since the run began [J]"),
    ("step", "Control step", "Wall time of a control step: median and 99th percentile [µs]"),
    ("late", "Wake-up late", "How late the arm's process wakes: median and 99th percentile [ms]"),
    ("missed", "Missed deadlines", "Frames that were not done when the next was due"),
    ("load", "Payload", "Mass at the tool that the controller is not told of [kg]"),
    ("tool", "Tool", "Point between the fingers in the base frame [cm]"),
)


class Understand:
    """The panel of one tab; the page's script fills it."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab = tab
        heading("Now")
        rows = "".join(
            f'<div title="{tip}"><dt>{name}</dt><dd id="fact-{key}">–</dd></div>'
            for key, name, tip in _FACTS
        )
        ui.html(f'<dl class="facts">{rows}</dl>', sanitize=False)
        heading("Time of a control step")
        ui.html(
            '<canvas id="histogram" width="660" height="220" role="img" '
            'aria-label="Histogram of the wall time of control steps"></canvas>',
            sanitize=False,
        )
        heading("Charts")
        with ui.element("div").classes("line"):
            pause = ui.switch("Pause").tooltip("Let the charts stand still while the arm goes on")
            pause.on_value_change(lambda: ui.run_javascript(f"studio.pause({_js(pause.value)})"))
            window = ui.select({5: "5 s", 10: "10 s", 30: "30 s", 60: "60 s"}, value=10)
            window.props('dense outlined aria-label="Time that the charts show"').classes("short")
            window.tooltip("Time that the charts show [s]; scroll in a chart to zoom")
            window.on_value_change(lambda: ui.run_javascript(f"studio.window({window.value})"))
        with ui.element("div").classes("line"):
            button("PNG", "image", "Save the four charts as a picture", _script("studio.png()"))
            button("CSV", "table_view", "Save the last minute as a table", _script("studio.csv()"))
        heading("Compare")
        ui.label("A kept run is drawn dashed under the next one.").classes("note")
        with ui.element("div").classes("line"):
            button("Keep run", "push_pin", "Keep the last run to compare", _script("studio.keep()"))
            button("Forget", "close", "Compare with nothing", _script("studio.forget()"))

    def refresh(self) -> None:
        """Do nothing: the page's script does it."""


def _script(code: str) -> Callable[[], object]:
    return lambda: ui.run_javascript(code)


def _js(value: object) -> str:
    return "true" if value else "false"

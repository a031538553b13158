"""The page: a bar with what matters most, the picture and the 3-D view, the charts, the panels."""

from __future__ import annotations

import json

from nicegui import ui

from arm3dof.runtime.live import commands as cmd
from arm3dof.ui.studio.charts import CHARTS, chart_options
from arm3dof.ui.studio.panels import PANELS
from arm3dof.ui.studio.studio import Studio
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button
from arm3dof.ui.style import COLORS

_HEAD = '<link rel="stylesheet" href="/studio/studio.css">'


def build_page(studio: Studio) -> None:
    """Build the page of one tab.

    Args:
        studio: what stands behind it.
    """
    tab = Tab(studio)
    ui.colors(primary=COLORS[0], positive=COLORS[2], negative="#B3261E", secondary=COLORS[1])
    dark = ui.dark_mode(None)
    ui.add_head_html(_HEAD)
    ui.query(".nicegui-content").classes("studio")
    with ui.element("header").classes("bar"):
        _build_bar(tab, dark)
    with ui.element("main").classes("board"):
        _build_picture()
        _build_view()
        charts = _build_charts(studio)
        _build_panels(tab)
    ui.timer(0.25, studio.alive)
    facts = {
        "tab": tab.id,
        "charts": charts,
        "joints": list(studio.robot.joint_names),
        "limits": studio.robot.limits.tau_max.tolist(),
        "speeds": studio.robot.limits.v_max.tolist(),
    }
    ui.add_body_html(
        f"<script>window.studioFacts = {json.dumps(facts)};</script>"
        '<script src="/studio/studio.js" defer></script>'
    )


def _build_bar(tab: Tab, dark: ui.dark_mode) -> None:
    ui.html("<h1>arm3dof <span>studio</span></h1>", sanitize=False)
    ui.html(
        '<p id="status" role="status" aria-live="polite" data-tone="calm">'
        "<i></i><span>Starting …</span></p>",
        sanitize=False,
    ).classes("status")
    with ui.element("nav").classes("transport").props('aria-label="Motion"'):
        button("Run", "play_arrow", "Drive the arm to its target (R)", lambda: tab.ask(cmd.Run()))
        button(
            "Pause",
            "pause",
            "Freeze the world's time, or let it go on (P)",
            lambda: _toggle_pause(tab),
        )
        button(
            "Step",
            "skip_next",
            "Let one control step pass while time stands still",
            lambda: tab.ask(cmd.StepOnce()),
        )
        button(
            "Stop",
            "stop",
            "Brake to rest as fast as the torque allows, then hold (Escape)",
            lambda: tab.ask(cmd.Stop()),
            color="negative",
        ).classes("stop")
    with ui.element("div").classes("corner"):
        take = button("Take the controls", "pan_tool", "Steer the arm from this tab", tab.take)
        take.classes("take")
        ui.timer(0.3, lambda: take.set_visibility(not tab.holds))
        button("", "contrast", "Light or dark", lambda: _turn(dark))


def _toggle_pause(tab: Tab) -> None:
    frame = tab.studio.arm.ring.latest()
    paused = frame is not None and bool(frame["paused"])
    tab.ask(cmd.Pause(not paused))


async def _turn(dark: ui.dark_mode) -> None:
    dark.set_value(not await ui.run_javascript("document.body.classList.contains('body--dark')"))


def _build_picture() -> None:
    with ui.element("section").classes("card picture").props('aria-label="Camera"'):
        ui.html(
            '<canvas id="picture" width="640" height="480" role="img" tabindex="0" '
            'aria-label="Live picture of the camera with what was recognised"></canvas>'
            '<canvas id="mask" width="640" height="480" role="img" hidden '
            'aria-label="Pixels inside the chosen colour bounds"></canvas>'
            '<p class="hint" id="picture-hint"></p>',
            sanitize=False,
        ).classes("stack")


def _build_view() -> None:
    with ui.element("section").classes("card view").props('aria-label="3-D view"'):
        ui.html(
            '<iframe id="view" src="/3d/?plain" title="3-D view of the arm"></iframe>',
            sanitize=False,
        ).classes("stack")


def _build_charts(studio: Studio) -> dict[str, int]:
    ids = {}
    with ui.element("section").classes("charts").props('aria-label="Charts"'):
        for chart in CHARTS:
            with ui.element("figure").classes("card chart"):
                ui.html(
                    f"<figcaption>{chart.title} <span>{chart.unit}</span></figcaption>",
                    sanitize=False,
                )
                made = ui.echart(chart_options(chart, studio.robot)).classes("plot")
                ids[chart.name] = made.id
    return ids


def _build_panels(tab: Tab) -> None:
    with ui.element("aside").classes("card panels").props('aria-label="Panels"'):
        with ui.tabs().props("dense no-caps narrow-indicator mobile-arrows") as tabs:
            for panel in PANELS:
                with ui.tab(panel.name, label=panel.name, icon=panel.icon):
                    ui.tooltip(panel.tip)
        with ui.tab_panels(tabs, value=PANELS[0].name, animated=False).classes("pages"):
            for panel in PANELS:
                with ui.tab_panel(panel.name):
                    panel.build(tab)

"""The page: a bar with what matters most, the picture and the 3-D view, the charts, the panels."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from nicegui import events, ui

from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.ui.studio.charts import CHARTS, chart_facts
from arm3dof.ui.studio.panels import PANELS, Built
from arm3dof.ui.studio.panels.aim import Aim
from arm3dof.ui.studio.panels.see import See
from arm3dof.ui.studio.studio import Studio
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button
from arm3dof.ui.style import COLORS, DARK_COLORS
from arm3dof.vision.locate import Located

_HEAD = '<link rel="stylesheet" href="/studio/studio.css">'
_SCRIPTS = ("/3d/figures.js", "/studio/charts.js", "/studio/studio.js")


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
        _build_charts(studio.robot)
        _build_panels(tab)
    ui.timer(0.25, studio.alive)
    facts = {
        "tab": tab.id,
        "grasps": studio.gripper is not None,
        "charts": [chart_facts(chart, studio.robot) for chart in CHARTS],
        "joints": list(studio.robot.joint_names),
        "colours": {"light": COLORS, "dark": DARK_COLORS},
    }
    ui.add_body_html(
        f"<script>window.studioFacts = {json.dumps(facts)};</script>"
        + "".join(f'<script src="{address}" defer></script>' for address in _SCRIPTS)
    )


def _build_bar(tab: Tab, dark: ui.dark_mode) -> None:
    ui.html("<h1>arm3dof <span>studio</span></h1>", sanitize=False)
    ui.html(
        '<p id="status" role="status" aria-live="polite" data-tone="calm">'
        "<i></i><span>Starting …</span></p>",
        sanitize=False,
    ).classes("status")
    with ui.element("nav").classes("transport").props('aria-label="Motion"'):
        if tab.studio.gripper is not None:
            button(
                "Grasp",
                "back_hand",
                "Let the arm grasp the nearest object and put it aside (G)",
                lambda: tab.attempt(tab.studio.grasp),
                color="primary",
            ).props("data-key=Grasp")
        run = button(
            "Run",
            "play_arrow",
            "Drive the arm to its target (R)",
            lambda: tab.ask(cmd.Run()),
            color="primary",
        )
        run.props("data-key=Run")
        button(
            "Pause",
            "pause",
            "Freeze the world's time, or let it go on (P)",
            lambda: _toggle_pause(tab),
        ).props("data-key=Pause")
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
        ).classes("stop").props("data-key=Stop")
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
            '<ul id="seen" aria-label="What was seen"></ul>'
            '<p id="nothing">Nothing that is looked for is in the picture.</p>',
            sanitize=False,
        ).classes("stack")


def _build_view() -> None:
    with ui.element("section").classes("card view").props('aria-label="3-D view"'):
        ui.html(
            '<iframe id="view" src="/3d/?plain" title="3-D view of the arm"></iframe>',
            sanitize=False,
        ).classes("stack")


def _build_charts(robot: Robot) -> None:
    names = "".join(f"<span><i></i>{name}</span>" for name in robot.joint_names)
    legend = f'<span class="legend">{names}</span>'
    with ui.element("section").classes("charts").props('aria-label="Charts"'):
        for chart in CHARTS:
            ui.html(
                f"<figcaption>{chart.title} <small>{chart.unit}</small>{legend}</figcaption>"
                f'<canvas id="chart-{chart.name}" class="plot" role="img" '
                f'aria-label="{chart.title} of each joint over time"></canvas>',
                sanitize=False,
                tag="figure",
            ).classes("card chart")
            legend = ""


def _build_panels(tab: Tab) -> None:
    built: dict[str, Built] = {}
    with ui.element("aside").classes("card panels").props('aria-label="Panels"'):
        with ui.tabs().props("dense no-caps narrow-indicator mobile-arrows") as tabs:
            for panel in PANELS:
                with ui.tab(panel.name, label=panel.name, icon=panel.icon):
                    ui.tooltip(panel.tip)
        pages = ui.tab_panels(tabs, value=PANELS[0].name, animated=False, keep_alive=True)
        with pages.classes("pages"):
            for panel in PANELS:
                with ui.tab_panel(panel.name):
                    built[panel.name] = panel.build(tab)
    ui.timer(0.3, lambda: _refresh(tab, built.values()))

    _listen(tab, tabs, built)


def _listen(tab: Tab, tabs: ui.tabs, built: Mapping[str, Built]) -> None:
    """Answer clicks into the picture, and on the things that were seen in it."""
    see, aim = built["See"], built["Aim"]

    def aim_at(found: Located) -> None:
        tabs.set_value("Aim")
        if isinstance(aim, Aim):
            aim.at(found.p_base)

    def on_picture(event: events.GenericEventArguments) -> None:
        u, v = int(event.args["u"]), int(event.args["v"])
        if tabs.value == "See" and isinstance(see, See):
            see.pick(u, v)
        elif (found := tab.studio.seen_at(u, v)) is not None:
            aim_at(found)
        else:
            ui.notify("There is nothing known at that place; learn its colour under 'See' first.")

    def on_aim(event: events.GenericEventArguments) -> None:
        located = tab.studio.located()
        index = int(event.args["index"])
        if index < len(located) and located[index].target == event.args["name"]:
            aim_at(located[index])

    ui.on("studio_picture", on_picture)
    ui.on("studio_aim", on_aim)
    ui.on("studio_grasp", lambda e: tab.attempt(lambda: tab.studio.grasp(str(e.args["name"]))))


def _refresh(tab: Tab, panels: Iterable[Built]) -> None:
    tab.tell_news()
    for panel in panels:
        panel.refresh()

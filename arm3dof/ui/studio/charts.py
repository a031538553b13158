"""The four charts of the paper, live: error, velocity, controller, torque with its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from arm3dof.model.robot import Robot
from arm3dof.ui.style import COLORS, LIMIT


@dataclass(frozen=True)
class Chart:
    """One chart.

    Attributes:
        name: the column that it draws.
        title: its title.
        unit: unit of its values.
        span: least range of values that it shows.
    """

    name: str
    title: str
    unit: str
    span: float


CHARTS = (
    Chart("e", "Error", "°", 2.0),
    Chart("v", "Velocity", "rad/s", 0.2),
    Chart("u", "Controller u", "rad/s²", 2.0),
    Chart("tau", "Torque", "N m", 0.2),
)

PLANNED = ("e", "v")
"""Charts in which the controller's plan is drawn ahead."""


def chart_options(chart: Chart, robot: Robot) -> dict[str, object]:
    """Return what a chart is made of; the page adds the data.

    Args:
        chart: the chart.
        robot: the arm whose joints are drawn.
    """
    quiet = {"show": False}
    series = []
    for k, name in enumerate(robot.joint_names):
        colour = COLORS[k % len(COLORS)]
        series.append(_line(name, colour))
        series.append(_line(f"{name} kept", colour, "dashed", opacity=0.6))
        if chart.name in PLANNED:
            series.append(_line(f"{name} plan", colour, "dotted"))
    if chart.name == "tau":
        series.append(_limits(robot.limits.tau_max.tolist()))
    return {
        "animation": False,
        "color": list(COLORS),
        "grid": {"left": 42, "right": 10, "top": 8, "bottom": 22},
        "tooltip": {"trigger": "axis", "confine": True, "transitionDuration": 0},
        "xAxis": {
            "type": "value",
            "scale": True,
            "axisLine": quiet,
            "axisTick": quiet,
            "splitLine": quiet,
            "minInterval": 1,
            "axisLabel": {"fontSize": 10, "showMinLabel": False, "showMaxLabel": False},
        },
        "yAxis": {
            "type": "value",
            "scale": True,
            "splitNumber": 4,
            "axisLabel": {"fontSize": 10, "showMinLabel": False, "showMaxLabel": False},
        },
        "dataZoom": [{"type": "inside", "xAxisIndex": 0, "filterMode": "none"}],
        "series": series,
    }


def _line(
    name: str, colour: str, kind: str = "solid", *, opacity: float = 1.0
) -> dict[str, object]:
    width = 1.8 if kind == "solid" else 1.3
    return {
        "id": name,
        "name": name,
        "type": "line",
        "showSymbol": False,
        "silent": True,
        "data": [],
        "lineStyle": {"width": width, "color": colour, "type": kind, "opacity": opacity},
        "itemStyle": {"color": colour},
    }


def _limits(limits: Sequence[float]) -> dict[str, object]:
    """Return dashed lines at the torque limits; they show when a torque comes near."""
    lines = [{"yAxis": sign * limit} for limit in sorted(set(limits)) for sign in (1, -1)]
    return {
        "id": "limits",
        "type": "line",
        "data": [],
        "silent": True,
        "markLine": {
            "symbol": "none",
            "silent": True,
            "animation": False,
            "label": {"show": False},
            "lineStyle": {"type": "dashed", "color": LIMIT, "width": 1},
            "data": lines,
        },
    }

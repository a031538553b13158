"""The four charts of the paper, live: error, velocity, controller, torque with its limits."""

from __future__ import annotations

from dataclasses import dataclass

from arm3dof.model.robot import Robot
from arm3dof.ui.style import COLORS


@dataclass(frozen=True)
class Chart:
    """One chart.

    Attributes:
        name: the column that it draws.
        title: its title.
        unit: unit of its values.
    """

    name: str
    title: str
    unit: str


CHARTS = (
    Chart("e", "Error", "°"),
    Chart("v", "Velocity", "rad/s"),
    Chart("u", "Controller u", "rad/s²"),
    Chart("tau", "Torque", "N m"),
)


def chart_options(chart: Chart, robot: Robot) -> dict[str, object]:
    """Return what a chart is made of; the page adds the data.

    Args:
        chart: the chart.
        robot: the arm whose joints are drawn.
    """
    quiet = {"show": False}
    series = [_line(name, COLORS[k % len(COLORS)]) for k, name in enumerate(robot.joint_names)]
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
            "axisLabel": {"fontSize": 10, "hideOverlap": True},
        },
        "yAxis": {
            "type": "value",
            "scale": True,
            "splitNumber": 4,
            "axisLabel": {"fontSize": 10},
        },
        "dataZoom": [{"type": "inside", "xAxisIndex": 0, "filterMode": "none"}],
        "series": series,
    }


def _line(name: str, colour: str, **more: object) -> dict[str, object]:
    return {
        "name": name,
        "type": "line",
        "showSymbol": False,
        "data": [],
        "lineStyle": {"width": 1.6, "color": colour},
        "itemStyle": {"color": colour},
        **more,
    }

"""The four charts of the paper, live: error, velocity, controller, torque with its limits."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from arm3dof.model.robot import Robot


@dataclass(frozen=True)
class Chart:
    """One chart, which the page's script draws.

    Attributes:
        name: the column that it draws.
        title: its title.
        unit: unit of its values.
        span: least range of values that it shows.
        scale: what a number of the column is multiplied by to have the unit.
        planned: whether the controller's plan is drawn ahead.
    """

    name: str
    title: str
    unit: str
    span: float
    scale: float = 1.0
    planned: bool = False


CHARTS = (
    Chart("e", "Error", "°", 2.0, scale=180 / math.pi, planned=True),
    Chart("v", "Velocity", "rad/s", 0.2, planned=True),
    Chart("u", "Controller u", "rad/s²", 2.0),
    Chart("tau", "Torque", "N m", 0.2),
)


def chart_facts(chart: Chart, robot: Robot) -> dict[str, object]:
    """Return what the page's script has to know of a chart.

    Args:
        chart: the chart.
        robot: the arm whose joints are drawn.
    """
    limits = sorted(set(robot.limits.tau_max.tolist())) if chart.name == "tau" else []
    return asdict(chart) | {"limits": limits}

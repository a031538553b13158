"""Figures of many runs: controllers side by side, and tracking against energy."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from arm3dof.runtime.compare import ENTRANTS, Comparison, Row
from arm3dof.runtime.metrics import SETTLED_ERROR
from arm3dof.ui.style import COLORS, INK, SETTLED_BAND, STYLE

_SIZE = (13.2, 8.2)  # inches
_MOST_TRACES = 3  # conditions that are drawn over time
_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_LEAST_ERROR = 1e-3  # [deg]: lower errors are drawn on this line


def plot_comparison(comparison: Comparison) -> Figure:
    """Draw errors over time, and error, settling, energy and step time of each controller."""
    with mpl.rc_context(dict(STYLE)):
        figure = Figure(figsize=_SIZE, layout="constrained")
        conditions = comparison.conditions[:_MOST_TRACES]
        halves = figure.subfigures(2, 1, hspace=0.06, squeeze=False)
        above, below = halves[0, 0], halves[1, 0]
        upper = above.subplots(1, len(conditions), sharey=True, squeeze=False)[0]
        for axes, condition in zip(upper, conditions, strict=True):
            _draw_traces(axes, comparison, condition)
        upper[0].set_ylabel("error, median over the moves [deg]")
        table = comparison.table()
        lower = below.subplots(1, 4, width_ratios=(1.5, 1.0, 1.0, 1.0))
        _draw_by_condition(lower[0], comparison)
        _draw_energy(lower[1], table)
        _draw_violations(lower[2], table)
        _draw_step_time(lower[3], table)
        for axes in lower[1:]:
            axes.set_ylim(len(table) - 0.4, -0.7)
            axes.set_yticks(range(len(table)), [""] * len(table))
            axes.grid(visible=False, axis="y")
        lower[1].set_yticks(range(len(table)), [ENTRANTS[row.controller].label for row in table])
        handles, names = upper[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=len(names))
        return figure


def _look(order: Sequence[str], name: str) -> tuple[str, str]:
    """Return the colour and the mark of a controller."""
    index = list(order).index(name)
    return COLORS[index % len(COLORS)], _MARKS[index % len(_MARKS)]


def _draw_traces(axes: Axes, comparison: Comparison, condition: str) -> None:
    band = float(np.rad2deg(SETTLED_ERROR))
    axes.axhspan(_LEAST_ERROR, band, color=SETTLED_BAND, linewidth=0, zorder=0.5)
    names = comparison.controllers
    for place, name in enumerate(names):
        runs = comparison.select(name, condition)
        error = np.rad2deg(np.median([run.error for run in runs], axis=0))
        color, _ = _look(names, name)
        line = np.maximum(error, _LEAST_ERROR)
        axes.plot(runs[0].t, line, color=color, label=ENTRANTS[name].label, zorder=9 - place)
    axes.set_yscale("log")
    axes.set_ylim(_LEAST_ERROR, None)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set(title=condition, xlabel="time [s]")


def _draw_by_condition(axes: Axes, comparison: Comparison) -> None:
    names, conditions = comparison.controllers, comparison.conditions
    largest = 0.0
    for row, condition in enumerate(conditions):
        for result in comparison.table(condition):
            color, mark = _look(names, result.controller)
            shift = 0.22 * (1 - 2 * names.index(result.controller) / max(len(names) - 1, 1))
            error = float(np.rad2deg(result.rms_error))
            largest = max(largest, error)
            axes.plot(error, row - shift, mark, color=color, markersize=7, zorder=3)
    axes.set_yticks(range(len(conditions)), conditions)
    axes.set_ylim(len(conditions) - 0.5, -0.5)
    axes.set_xlim(0, 1.06 * largest)
    axes.set(title="RMS error", xlabel="over the whole run [deg]")


def _draw_energy(axes: Axes, table: Sequence[Row]) -> None:
    _bars(axes, table, [row.energy for row in table], "{:.2f}")
    axes.set(title="Energy", xlabel="mean over all runs [J]")


def _draw_violations(axes: Axes, table: Sequence[Row]) -> None:
    broken = [
        float(row.torque_violations + row.velocity_violations + row.position_violations)
        for row in table
    ]
    _bars(axes, table, broken, "{:.0f}")
    axes.set(title="Limits exceeded", xlabel="plant steps, all runs")


def _draw_step_time(axes: Axes, table: Sequence[Row]) -> None:
    _bars(axes, table, [1e6 * row.step_time_p50 for row in table], "{:.0f}")
    axes.set(title="Control step", xlabel="median wall time [µs]")


def _bars(axes: Axes, table: Sequence[Row], values: Sequence[float], form: str) -> None:
    names = [row.controller for row in table]
    for place, (name, value) in enumerate(zip(names, values, strict=True)):
        axes.barh(place, value, color=_look(names, name)[0], height=0.62, zorder=3)
        text, beside = form.format(value), (4, 0)
        axes.annotate(
            text, (value, place), beside, textcoords="offset points", va="center", color=INK
        )
    axes.set_xlim(0, 1.25 * max(*values, 1e-9))

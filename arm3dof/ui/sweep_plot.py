"""The figure of a sweep: tracking against energy, with the best compromises marked."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from arm3dof.runtime.sweep import Sweep
from arm3dof.ui.style import COLORS, DASHES, INK, SETTLED, SOFT, STYLE

_SIZE = (12.6, 5.6)  # inches


def plot_sweep(sweep: Sweep) -> Figure:
    """Draw RMS error and settling time against energy, one line a family.

    The Pareto front is marked: the runs to which no other is better in both.
    """
    with mpl.rc_context(dict(STYLE)):
        figure = Figure(figsize=_SIZE, layout="constrained")
        left, right = figure.subplots(1, 2)
        _draw(left, sweep, "rms_error_rad", float(np.rad2deg(1.0)))
        left.set(title="Tracking against energy", ylabel="RMS error [deg]")
        _draw(right, sweep, "settling_time_s", 1.0)
        right.set(title="Settling against energy", ylabel="settling time [s]")
        handles, names = left.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=min(len(names), 5))
        return figure


def _draw(axes: Axes, sweep: Sweep, name: str, scale: float) -> None:
    energy, error = sweep.column("energy_j"), scale * sweep.column(name)
    families = list(dict.fromkeys(outcome.point.family for outcome in sweep.outcomes))
    for place, family in enumerate(families):
        rows = [k for k, it in enumerate(sweep.outcomes) if it.point.family == family]
        color = COLORS[place % len(COLORS)]
        dashes = DASHES[place // len(COLORS) % len(DASHES)]
        axes.plot(
            energy[rows],
            error[rows],
            "o",
            linestyle=dashes,
            linewidth=1.3,
            markersize=5,
            color=color,
            label=family,
            zorder=3,
        )
        for row in {rows[0], rows[-1]}:
            _note(axes, energy[row], error[row], sweep.outcomes[row].point.label, color)
    front = np.flatnonzero(sweep.front("energy_j", name))
    front = front[np.argsort(energy[front])]
    axes.plot(energy[front], error[front], color=SETTLED, linewidth=6, alpha=0.18, zorder=1)
    axes.plot(
        energy[front],
        error[front],
        "o",
        markersize=11,
        markerfacecolor="none",
        markeredgecolor=INK,
        linewidth=0,
        label="Pareto front",
        zorder=4,
    )
    axes.margins(0.09)
    axes.set_xlabel("energy, integral of |τ · v| [J]")
    missing = int(np.isnan(error).sum())
    if missing:
        text = f"{missing} of {error.size} runs did not settle"
        axes.annotate(
            text, (0.99, 0.99), xycoords="axes fraction", ha="right", va="top", color=SOFT
        )


def _note(axes: Axes, x: float, y: float, text: str, color: str) -> None:
    if np.isfinite(x) and np.isfinite(y):
        axes.annotate(
            text, (x, y), (7, 5), textcoords="offset points", color=color, fontsize=8.5, zorder=5
        )

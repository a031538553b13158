"""The paper's figures 9 to 12, drawn from a recording: error, velocity, input and torque.

The figures are matplotlib ``Figure`` objects without pyplot: no global state, no window, safe in
any thread.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from arm3dof.files import write_atomically
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from arm3dof.ui import quantities
from arm3dof.ui.quantities import NEAR, QUANTITIES, Quantity, extreme_rows
from arm3dof.ui.style import COLORS, DASHES, LIMIT, SETTLED, SETTLED_BAND, SOFT, STYLE

SIZE = (7.2, 4.0)  # inches
_PNG_DPI = 150
OVERVIEW_SIZE = (12.6, 7.6)
MAX_POINTS = 3000  # of a line; a longer run is drawn by the extremes of equal pieces


def plot_error(recording: Recording) -> Figure:
    """Draw the joint errors q_target - q in degrees (the paper's figure 9)."""
    return _single(recording, quantities.error(recording))


def plot_velocity(recording: Recording) -> Figure:
    """Draw the joint velocities with their limits (the paper's figure 10)."""
    return _single(recording, quantities.velocity(recording))


def plot_controller(recording: Recording) -> Figure:
    """Draw the controller's input u, a joint acceleration (the paper's figure 11)."""
    return _single(recording, quantities.controller(recording))


def plot_torque(recording: Recording) -> Figure:
    """Draw the joint torques with their limits (the paper's figure 12)."""
    return _single(recording, quantities.torque(recording))


def plot_overview(recording: Recording) -> Figure:
    """Draw all four in one figure, with one legend."""
    with mpl.rc_context(dict(STYLE)):
        figure = Figure(figsize=OVERVIEW_SIZE, layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        for axes, quantity in zip(grid.flat, QUANTITIES, strict=True):
            _draw(axes, recording, quantity(recording))
        for axes in grid[0]:
            axes.set_xlabel("")
        handles, names = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=min(len(names), 8))
        return figure


def save_figures(recording: Recording, folder: str | Path) -> tuple[Path, ...]:
    """Write every figure as a PNG file, each whole or not at all.

    Args:
        recording: the run.
        folder: where to; it is made when it does not exist.

    Returns:
        The paths: error, velocity, controller, torque, overview.

    Raises:
        InputError: the folder cannot be written.
    """
    paths = []
    for name, plot in FIGURES.items():
        paths.append(Path(folder) / f"{name}.png")
        write_atomically(paths[-1], png(plot(recording)))
    return tuple(paths)


def png(figure: Figure) -> bytes:
    """Return a figure as the bytes of a PNG file.

    They are ``savefig``'s, which would draw the whole figure a first time for its layout alone.
    """
    data, dpi = io.BytesIO(), figure.dpi
    with mpl.rc_context(dict(STYLE)):
        try:
            figure.dpi = _PNG_DPI
            canvas = FigureCanvasAgg(figure)
            canvas.print_png(data)  # type: ignore[no-untyped-call]  # matplotlib tells no types of it
        finally:
            figure.dpi = dpi
    return data.getvalue()


FIGURES: Mapping[str, Callable[[Recording], Figure]] = MappingProxyType(
    {
        "error": plot_error,
        "velocity": plot_velocity,
        "controller": plot_controller,
        "torque": plot_torque,
        "overview": plot_overview,
    }
)
"""Every figure by the name of its file."""


# ---- how it is drawn ---------------------------------------------------------------------------


def _single(recording: Recording, quantity: Quantity) -> Figure:
    with mpl.rc_context(dict(STYLE)):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.subplots()
        _draw(axes, recording, quantity)
        names = recording.joint_names
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=min(len(names), 4),
            borderaxespad=0.2,
            columnspacing=1.4,
            handlelength=1.6,
        )
        return figure


def _draw(axes: Axes, recording: Recording, quantity: Quantity) -> None:
    time = recording.t - recording.t[0]
    axes.axhline(0, color=SOFT, linewidth=0.8, zorder=1)
    if quantity.band is not None:
        axes.axhspan(-quantity.band, quantity.band, color=SETTLED_BAND, linewidth=0, zorder=0.5)
    style = "steps-post" if quantity.holds else "default"
    for joint, name in enumerate(recording.joint_names):
        at, values = _thinned(time, quantity.values[:, joint])
        dashes = DASHES[joint // len(COLORS) % len(DASHES)]
        color = COLORS[joint % len(COLORS)]
        axes.plot(at, values, color=color, linestyle=dashes, drawstyle=style, label=name, zorder=3)
    axes.set(title=quantity.title, ylabel=quantity.label, xlabel="time [s]")
    row_dt = float(time[-1] - time[-2]) if len(time) > 1 else recording.control_dt
    axes.set_xlim(0, float(time[-1]) + row_dt)
    if quantity.limits is not None:
        _draw_limits(axes, quantity, recording.joint_names)
    settling_time = summarise(recording).settling_time
    if settling_time is None:
        return
    _mark_settling(axes, settling_time)
    if quantity.zooms and quantity.band and 0 < settling_time < 0.45 * axes.get_xlim()[1]:
        _draw_zoom(axes, time, quantity)


def _draw_limits(axes: Axes, quantity: Quantity, names: Sequence[str]) -> None:
    """Draw the limits, or say what they are when they are far outside the picture."""
    limits = np.asarray(quantity.limits)
    finite = np.unique(limits[np.isfinite(limits)])
    peak = float(np.nanmax(np.abs(quantity.values), initial=0.0))
    is_shared = finite.size == 1 and bool(np.isfinite(limits).all())
    for limit in finite:
        text = f"limit ±{limit:g} {quantity.unit}"
        if not is_shared:
            owners = [name for name, own in zip(names, limits, strict=True) if own == limit]
            text += f" ({', '.join(owners)})" if len(owners) < 3 else f" ({len(owners)} joints)"
        if quantity.must_show_limit or limit <= NEAR * peak:
            for sign in (-1, 1):
                axes.axhline(sign * limit, color=LIMIT, linewidth=1.1, linestyle=(0, (6, 3)))
            _note(axes, 0.995, limit, text, "bottom")
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom - 0.04 * (top - bottom), top + 0.08 * (top - bottom))
    if not quantity.must_show_limit and finite.size and finite.min() > NEAR * peak:
        text = f"limit ±{finite.min():g} {quantity.unit}, outside the picture"
        _note(axes, 0.995, axes.get_ylim()[1], text, "top")


def _note(axes: Axes, x: float, y: float, text: str, side: str) -> None:
    axes.annotate(
        text,
        (x, y),
        (0, 2 if side == "bottom" else -3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        color=LIMIT,
        fontsize=8.5,
        ha="right",
        va=side,
        zorder=4,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6},
    )


def _draw_zoom(axes: Axes, time: Array, quantity: Quantity) -> None:
    """Show the settled end of a run and its band again, enlarged, where the picture is empty."""
    band = quantity.band or 1.0
    zoom = axes.inset_axes((0.5, 0.5, 0.48, 0.42))
    zoom.axhspan(-band, band, color=SETTLED_BAND, linewidth=0, zorder=0.5)
    zoom.axhline(0, color=SOFT, linewidth=0.8, zorder=1)
    for joint, values in enumerate(quantity.values.T):
        zoom.plot(*_thinned(time, values), color=COLORS[joint % len(COLORS)], linewidth=1.4)
    zoom.set_xlim(axes.get_xlim())
    zoom.set_ylim(-2.2 * band, 2.2 * band)
    zoom.set_yticks([-band, 0, band], [f"−{band:g}", "0", f"{band:g}"])
    zoom.tick_params(labelsize=8)
    zoom.set_title(
        "settled band, enlarged", fontsize=8.5, fontweight="normal", color=SETTLED, pad=4
    )


def _mark_settling(axes: Axes, settling_time: float) -> None:
    axes.axvline(settling_time, color=SETTLED, linewidth=1.1, linestyle=(0, (2, 2)), zorder=2)
    is_late = settling_time > 0.6 * axes.get_xlim()[1]
    bottom, top = axes.get_ylim()
    is_low = -bottom < 0.2 * (top - bottom)  # the curves end near the lower edge
    axes.annotate(
        f"settled {settling_time:.2f} s",
        (settling_time, 0.98 if is_low else 0.02),
        (-5 if is_late else 5, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        color=SETTLED,
        fontsize=8.5,
        ha="right" if is_late else "left",
        va="top" if is_low else "bottom",
    )


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    rows = extreme_rows(values, MAX_POINTS)
    return time[rows], values[rows]

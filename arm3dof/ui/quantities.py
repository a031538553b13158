"""The four quantities that every picture of a run shows: error, velocity, input and torque."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm3dof.runtime.metrics import SETTLED_ERROR, SETTLED_SPEED
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array

NEAR = 3.0  # limits are inside the picture when they are at most so many times the largest value


@dataclass(frozen=True)
class Quantity:
    """What one chart shows.

    Attributes:
        title: above the axes.
        label: along the y axis, with the unit.
        values: the column, shape (n, nv), in the chart's unit.
        limits: largest magnitude of each joint, shape (nv,), or ``None``.
        unit: of the values and limits.
        band: half height of the band in which a joint counts as settled, or ``None``.
        must_show_limit: whether the limit is drawn however far away it is.
        holds: whether the value is held between control steps (drawn as steps).
        zooms: whether the band is shown enlarged where there is room.
    """

    title: str
    label: str
    values: Array
    limits: Array | None
    unit: str
    band: float | None = None
    must_show_limit: bool = False
    holds: bool = False
    zooms: bool = False


def error(r: Recording) -> Quantity:
    """Return the joint errors q_target - q in degrees (the paper's figure 9)."""
    band = float(np.rad2deg(SETTLED_ERROR))
    return Quantity("Joint error", "error e [deg]", np.rad2deg(r.e), None, "deg", band, zooms=True)


def velocity(r: Recording) -> Quantity:
    """Return the joint velocities with their limits (the paper's figure 10)."""
    return Quantity(
        "Joint velocity", "velocity [rad/s]", r.v, r.limits.v_max, "rad/s", SETTLED_SPEED
    )


def controller(r: Recording) -> Quantity:
    """Return the controller's input u, a joint acceleration (the paper's figure 11)."""
    return Quantity("Controller", "input u [rad/s²]", r.u, None, "rad/s²", holds=True)


def torque(r: Recording) -> Quantity:
    """Return the joint torques with their limits (the paper's figure 12)."""
    return Quantity(
        "Joint torque",
        "torque τ [N m]",
        r.tau,
        r.limits.tau_max,
        "N m",
        must_show_limit=True,
        holds=True,
    )


QUANTITIES = (error, velocity, controller, torque)
"""What makes each quantity from a recording, in the order of the paper's figures."""


def extreme_rows(values: Array, count: int) -> NDArray[np.intp]:
    """Return at most about ``count`` rows of a column such that no peak between them is lost.

    Args:
        values: the column, shape (n,).
        count: rows to keep; all are kept when there are no more.

    Returns:
        Rows in order, the first and the last among them: of each of ``count / 2`` equal pieces
        that with the smallest and that with the largest value.
    """
    if len(values) <= count:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), count // 2 + 1).astype(int)
    rows: set[int] = {0, len(values) - 1}
    for start, end in itertools.pairwise(edges):
        rows.add(start + int(np.argmin(values[start:end])))
        rows.add(start + int(np.argmax(values[start:end])))
    return np.array(sorted(rows), dtype=np.intp)

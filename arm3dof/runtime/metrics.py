"""Figures of merit of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arm3dof.runtime.recording import Recording, status_counts

SETTLED_ERROR = np.deg2rad(0.5)
"""A settled joint is this close to its target [rad]."""
SETTLED_SPEED = 0.05
"""A settled joint is slower than this [rad/s]."""
_TORQUE_TOLERANCE = 1e-9  # [N m]


@dataclass(frozen=True)
class Metrics:
    """What a run achieved.

    Attributes:
        settled: whether all |e| < 0.5 deg and |v| < 0.05 rad/s from some time to the end.
        settling_time: that time, counted from the start [s]; ``None`` when not settled.
        final_error: largest |e| at the end [rad].
        rms_error: root mean square of |e| over time and joints [rad].
        peak_torque: largest |tau| [N m].
        torque_limit: the limit of the joint in which the peak is nearest to its limit [N m].
        torque_violations: plant steps in which a torque exceeded its limit.
        velocity_violations: plant steps in which a speed exceeded its limit by over 1 %.
        position_violations: plant steps in which a joint was over 0.5 deg outside its range.
        energy: integral of |tau . v| [J].
        torque_squared: integral of tau . tau [N^2 m^2 s].
        saturation: share of control steps with a torque at its limit.
        step_time_p50: median wall time of a control step [s].
        step_time_p99: 99th percentile of it [s].
        step_time_max: largest of it [s].
        status_counts: how often each status occurred.
    """

    settled: bool
    settling_time: float | None
    final_error: float
    rms_error: float
    peak_torque: float
    torque_limit: float
    torque_violations: int
    velocity_violations: int
    position_violations: int
    energy: float
    torque_squared: float
    saturation: float
    step_time_p50: float
    step_time_p99: float
    step_time_max: float
    status_counts: dict[str, int]


def summarise(recording: Recording) -> Metrics:
    """Compute the figures of merit of a recording."""
    r, limits = recording, recording.limits
    outside = (np.abs(r.e) >= SETTLED_ERROR) | (np.abs(r.v) >= SETTLED_SPEED)
    unsettled = np.flatnonzero(outside.any(axis=1))
    first_settled = int(unsettled[-1]) + 1 if unsettled.size else 0
    settled = first_settled < len(r)
    row_dt = np.diff(r.t, append=2 * r.t[-1] - r.t[-2] if len(r) > 1 else r.t[-1])
    torque = np.abs(r.tau)
    over_speed = np.abs(r.v) > 1.01 * limits.v_max
    slack = SETTLED_ERROR
    out_of_range = (r.q < limits.q_min - slack) | (r.q > limits.q_max + slack)
    step_time = r.step_time[r.control_rows]
    p50, p99 = np.percentile(step_time, [50, 99])
    at_limit = torque[r.control_rows] >= (1 - 1e-6) * limits.tau_max
    nearest = int(np.argmax(torque.max(axis=0) / limits.tau_max))
    return Metrics(
        settled=settled,
        settling_time=float(r.t[first_settled] - r.t[0]) if settled else None,
        final_error=float(np.abs(r.e[-1]).max()),
        rms_error=float(np.sqrt(np.mean(r.e**2))),
        peak_torque=float(torque[:, nearest].max()),
        torque_limit=float(limits.tau_max[nearest]),
        torque_violations=int((torque > limits.tau_max + _TORQUE_TOLERANCE).any(axis=1).sum()),
        velocity_violations=int(over_speed.any(axis=1).sum()),
        position_violations=int(out_of_range.any(axis=1).sum()),
        energy=float(np.abs(np.sum(r.tau * r.v, axis=1)) @ row_dt),
        torque_squared=float(np.sum(r.tau**2, axis=1) @ row_dt),
        saturation=float(at_limit.any(axis=1).mean()),
        step_time_p50=float(p50),
        step_time_p99=float(p99),
        step_time_max=float(step_time.max()),
        status_counts=status_counts(recording),
    )

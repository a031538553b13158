"""Gains of the joint filter: what one sample's measurements are worth, for every noise level.

Over a sample T a joint moves with the acceleration u that its command is meant to give, plus what
nobody expected: a lasting part d, which walks, and a passing one, w:

    a = u + d + w,   q+ = q + T v + T^2/2 a,   v+ = v + T a,   d+ = d + e.

At the end of the sample a drive reports its encoder's position, with white noise sigma, and the
velocity that it differentiates from it. If the encoder was read in between as well, the mean of
these readings and the slope of a line through them hold what else they tell of q, v and a.

The gains that the filter settles to (Anderson and Moore 1979) depend on one number alone, the ratio
of the noise to T^2 s, with s the standard deviation of w. They are tabulated over it once and
looked up in every step. Where the ratio is small, measurements are believed as they are.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from arm3dof.state import Array

VELOCITY_NOISE = 20.0
"""Noise of a velocity that a drive derives from its encoder, in multiples of sigma [1/s]."""
_CORRELATION = 0.6  # between the noises of a drive's position and velocity

_JERKS = (0.2, 0.3)  # how far q and v miss constant acceleration, in units of T^2 s and T s
_TRUSTED = 0.25  # ratio from which on an unexpected acceleration is less trusted to last
_LEAST_WALK = 1e-6  # so that d can always be estimated
_PER_OCTAVE = 4  # rows of the table
_OCTAVES = (-4, 14)  # ratios of the table, as powers of 2
_DOUBLINGS = 16  # 2^16 samples are as good as endlessly many


class Sensor(NamedTuple):
    """How a sample's m measurements follow from q, v and a at its end.

    Attributes:
        of_state: derivative by [q, v, a], shape (m, 3).
        noise: their covariance for encoder noise of variance 1, shape (m, m).
        summary: makes mean and slope of the readings, shape (2, count); no rows for one reading.
    """

    of_state: Array
    noise: Array
    summary: Array


class Gains(NamedTuple):
    """The filter's gains, one row a ratio; the first row believes what is measured.

    Attributes:
        edges: ratio from which on each row but the first is taken; one less than rows.
        gain: of the innovations on [q, v, d], rows of 3 by m.
        telling: standard deviations of the last two innovations at s = 1, a pair a row.
    """

    edges: list[float]
    gain: list[list[list[float]]]
    telling: list[list[float]]


@lru_cache(maxsize=16)
def sensor(dt: float, count: int) -> Sensor:
    """Return what a sample tells: position and velocity at its end, and mean and slope.

    Args:
        dt: T [s].
        count: readings in a sample, evenly spaced, the last at its end; 1 for that one alone.
    """
    both = _CORRELATION * VELOCITY_NOISE
    report = np.array([[1.0, both], [both, VELOCITY_NOISE**2]])
    if count == 1:
        return Sensor(np.eye(2, 3), report, np.zeros((0, 1)))
    before = dt / count * np.arange(count - 1, -1, -1)
    centred = before.mean() - before
    summary = np.stack([np.full(count, 1.0 / count), centred / (centred @ centred)])
    motion = np.stack([np.ones(count), -before, before**2 / 2], axis=1)
    noise = np.zeros((4, 4))
    noise[:2, :2], noise[2:, 2:] = report, summary @ summary.T
    return Sensor(np.vstack([np.eye(2, 3), summary @ motion]), noise, summary)


@lru_cache(maxsize=16)
def gains(dt: float, learning: float, count: int) -> Gains:
    """Return the gains for all ratios.

    Args:
        dt: T [s].
        learning: share of an unexpected acceleration that is taken to last without noise, 0 to 1.
        count: readings in a sample.
    """
    seen = sensor(dt, count)
    move = np.array([[1, dt, 0, dt**2 / 2], [0, 1, 0, dt], [0, 0, 0, 1], [0, 0, 0, 1]])
    passing = np.array([dt**2 / 2, dt, 1.0, 0.0])
    jerks = np.diag([(_JERKS[0] * dt**2) ** 2, (_JERKS[1] * dt) ** 2, 0.0, 0.0])
    look = np.hstack([seen.of_state, np.zeros((len(seen.of_state), 1))])
    free_walk = learning / np.sqrt(max(1 - learning, 1e-3))
    gain, spread = [np.zeros((3, len(look)))], [np.zeros(len(look))]
    gain[0][0, 0], gain[0][1, 1], gain[0][2, 1] = 1.0, 1.0, learning / dt
    octaves = np.arange(*_OCTAVES, 1 / _PER_OCTAVE)
    for ratio in (2.0**octaves).tolist():
        walk = free_walk * min(_TRUSTED / ratio, 1.0) ** 0.5
        unknown = np.outer(passing, passing) + jerks
        unknown[3, 3] = max(walk, _LEAST_WALK) ** 2
        noise = (ratio * dt**2) ** 2 * seen.noise
        P = _lasting_covariance(move, look, unknown, noise)
        S = look @ P @ look.T + noise
        gain.append((P @ look.T @ np.linalg.inv(S))[[0, 1, 3]])
        spread.append(np.sqrt(S.diagonal()))
    edges = 2.0 ** (octaves - 0.5 / _PER_OCTAVE)
    return Gains(edges.tolist(), np.array(gain).tolist(), np.array(spread)[:, -2:].tolist())


def _lasting_covariance(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Return the covariance before a measurement that the filter settles to, by doubling."""
    step, known, P = A.T, C.T @ np.linalg.inv(R) @ C, Q
    for _ in range(_DOUBLINGS):
        half = np.linalg.inv(np.eye(len(A)) + known @ P)
        known, P, step = (
            known + step @ half @ known @ step.T,
            P + step.T @ P @ half @ step,
            step @ half @ step,
        )
    return np.asarray((P + P.T) / 2)

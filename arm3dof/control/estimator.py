"""Where the arm is and what accelerates it, from noisy encoders: a Kalman filter a joint.

The filter's model and gains are those of ``kalman``. Its two levels are learned on the way. The
noise comes from the measurements alone: within a sample, from how far readings are from a smooth
curve; where there is one reading a sample, from how far a position is from where the velocities
lead while the arm moves little. And how much happens that nobody expects comes from the
innovations: one that is larger than noise explains is a surprise, after which the filter is fast
for a while and then calms down (innovation-based adaptation: Mehra 1972).

Without noise the filter believes every measurement, as if it were not there.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from functools import lru_cache
from operator import mul

import numpy as np

from arm3dof.control.kalman import VELOCITY_NOISE, Gains, gains, sensor
from arm3dof.state import Array, JointState

_LEAST_SURPRISE = 0.1  # [rad/s^2]: standard deviation of unexpected accelerations at rest
_SURPRISING = 4.0  # an innovation of more standard deviations than that is no noise
_CALMING = 0.7  # share of a surprise that is left one step later
_NEGLIGIBLE = 1e-7  # [rad]: less noise than that is none

_FEWEST = 8  # readings in a sample, of which something can be made
_MOST = 1000  # and as many as are kept
_SMOOTH = 4  # degrees of freedom of a smooth curve through them
_ROUGHNESS_MEMORY = 0.8  # weight of the past in what is known of the noise, in each step
_GROWTH = 10.0  # most that one sample may be rougher than what is known, as a variance
_GAP_MEMORY = 0.98
_GENTLE, _SLOW = 1.0, 0.3  # [rad/s^2, rad/s]: beyond, a gap begins to tell less about noise


Sample = tuple[list[float], list[float], list[float]]
"""What happened in a sample, as far as it can be told, of each joint: its position in the middle
[rad], its mean velocity [rad/s], and its unexpected acceleration that will last [rad/s^2]."""


class StateEstimator:
    """Estimates the state of all joints, and how much of what happened was not expected.

    Attributes:
        q: estimated positions, shape (nv,) [rad].
        v: estimated velocities, shape (nv,) [rad/s].
        noise: believed standard deviation of a measured position, of each joint [rad].
        most_noise: the largest of them [rad].
    """

    def __init__(self, nv: int, dt: float, learning: float, noise: float | None) -> None:
        """Create an estimator that has seen nothing.

        Args:
            nv: number of joints.
            dt: time between updates [s].
            learning: share of an unexpected acceleration that is taken to last without noise.
            noise: standard deviation of measured positions [rad]; ``None`` to learn it.
        """
        self._nv, self._dt, self._learning, self._given = nv, dt, learning, noise
        self._gains, self._share = gains(dt, learning, 1), learning / dt
        self._per_sample = dt**-2
        # a surprise is read from the most telling measurements: [q, v], or [mean, slope]
        self._telling = {0: (2 / dt**2, 1 / dt), 2: (6 / dt**2, 2 / dt)}
        self._no_others: list[tuple[float, ...]] = [()] * nv
        self._readings, self._first_time = np.empty((_MOST, nv)), 0.0
        self._gap_variance = 2.0 + (VELOCITY_NOISE * dt) ** 2 / 2  # of noise of variance 1
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._variance, self._weight = [0.0] * self._nv, 0.0
        self.most_noise = self._given or 0.0
        self.noise = [self.most_noise] * self._nv
        self.restart(JointState(0.0, np.zeros(self._nv), np.zeros(self._nv)))

    def restart(self, state: JointState) -> None:
        """Believe a measurement that does not follow from those before."""
        self.q, self.v = state.q, state.v
        self._numbers = state.q.tolist(), state.v.tolist()  # the same as plain numbers
        self._surprise = [_LEAST_SURPRISE] * self._nv
        self._read = 0

    def drop_readings(self) -> None:
        """Forget the readings since the last update."""
        self._read = 0

    def observe(self, state: JointState) -> None:
        """Take note of a reading between two updates."""
        if self._read == 0:
            self._first_time = state.t
        if self._read + 1 < len(self._readings):
            self._readings[self._read] = state.q
            self._read += 1

    def update(self, u: Array, gap: Iterable[float], state: JointState) -> Sample:
        """Take in a measurement at the end of a sample.

        Args:
            u: expected acceleration since the last measurement, shape (nv,) [rad/s^2].
            gap: how far each measured position is from where the last one and the mean of the two
                measured velocities lead [rad].
            state: the measurement.

        Returns:
            What happened in the sample.
        """
        # plain numbers, joint by joint: arrays this small cost more than what is done with them
        readings, expected = self._sample(state), u.tolist()
        if self._given is None:
            if readings is None:
                self._learn_from_gap(gap, expected)
            else:
                self._learn_from_roughness(readings)
        if self.most_noise < _NEGLIGIBLE:
            return self._believe(state, expected)
        if readings is None:
            return self._filter(state, expected, self._no_others, self._gains)
        dt, seen = self._dt, sensor(self._dt, len(readings))
        led = np.stack((self.q + dt * (self.v + dt / 2 * u), self.v + dt * u, u))
        others = (seen.summary @ readings - seen.of_state[2:] @ led).T.tolist()
        return self._filter(state, expected, others, gains(dt, self._learning, len(readings)))

    def _believe(self, state: JointState, u: list[float]) -> Sample:
        """Take the measurement for the state."""
        dt, share, (q, v) = self._dt, self._share, self._numbers
        self.q, self.v = state.q, state.v
        self._numbers = q_now, v_now = state.q.tolist(), state.v.tolist()
        q_middle = [0.5 * (start + end) for start, end in zip(q, q_now)]
        v_middle = [0.5 * (start + end) for start, end in zip(v, v_now)]
        speeds = zip(v, v_now, u)
        return q_middle, v_middle, [share * (v1 - v0 - dt * a) for v0, v1, a in speeds]

    def _filter(
        self, state: JointState, u: list[float], others: Sequence[Sequence[float]], table: Gains
    ) -> Sample:
        """Correct the estimate by what was not expected, and be surprised by it.

        Args:
            state: the measurement.
            u: expected accelerations [rad/s^2].
            others: innovations of each joint beyond those of position and velocity: none, or two
                which tell more of a surprise than these.
            table: what innovations are worth.

        Returns:
            What happened in the sample.
        """
        dt, half, per_sample = self._dt, self._dt / 2, self._per_sample
        edges, gain, telling = table
        far, fast = self._telling[len(others[0])]
        positions, velocities, surprises, believes = [], [], [], True
        q_middle, v_middle, lastings = [], [], []
        measured = state.q.tolist(), state.v.tolist()
        known = *self._numbers, u, *measured, self.noise, self._surprise, others
        for q, v, a, q1, v1, noise, surprise, more in zip(*known):
            too_far, too_fast = q1 - q - dt * (v + half * a), v1 - v - dt * a
            place, rate = more or (too_far, too_fast)
            scale, likely = noise * per_sample, _SURPRISING * surprise
            row = bisect_left(edges, scale / surprise)
            spread, spread_rate = telling[row]
            distance = far * (abs(place) - likely * spread)
            speed = fast * (abs(rate) - likely * spread_rate)
            if distance > surprise or speed > surprise:
                surprise = max(distance, speed)
                row = bisect_left(edges, scale / surprise)
            calmer = _CALMING * surprise
            surprises.append(calmer if calmer > _LEAST_SURPRISE else _LEAST_SURPRISE)
            if row == 0:  # it believes what is measured
                q_new, v_new, lasting = q1, v1, self._share * too_fast
            else:
                believes, of_q, of_v = False, q1 - too_far, v1 - too_fast
                if more:
                    seen = too_far, too_fast, *more
                    by_q, by_v, lasting = (sum(map(mul, worth, seen)) for worth in gain[row])
                else:  # the usual case, written out
                    (qq, qv), (vq, vv), (lq, lv) = gain[row]
                    by_q, by_v = qq * too_far + qv * too_fast, vq * too_far + vv * too_fast
                    lasting = lq * too_far + lv * too_fast
                q_new, v_new = of_q + by_q, of_v + by_v
            positions.append(q_new)
            velocities.append(v_new)
            q_middle.append(0.5 * (q + q_new))
            v_middle.append(0.5 * (v + v_new))
            lastings.append(lasting)
        self._surprise, self._numbers = surprises, (positions, velocities)
        if believes:
            self.q, self.v = state.q, state.v
        else:
            self.q, self.v = np.array(positions), np.array(velocities)
        return q_middle, v_middle, lastings

    def _sample(self, state: JointState) -> Array | None:
        """Return the readings of a sample, shape (count, nv), if they are many and evenly spaced.

        Only first and last times are looked at.
        """
        count, self._read = self._read + 1, 0
        if count < _FEWEST:
            return None
        if abs(state.t - self._first_time - self._dt * (1 - 1 / count)) > 1e-3 * self._dt:
            return None
        self._readings[count - 1] = state.q
        readings = self._readings[:count]
        return readings if math.isfinite(readings.sum()) else None

    def _learn_from_roughness(self, readings: Array) -> None:
        """Learn the noise from how far readings are from a smooth curve through them."""
        rough = _roughness(len(readings)) @ (readings - readings[-1])
        variance = np.einsum("ij,ij->j", rough, rough) / (len(readings) - _SMOOTH)
        known = np.array(self._variance)
        if self._weight > 0:  # a blow within the sample is rough as well, but only once
            variance = np.minimum(variance, _GROWTH * known + _NEGLIGIBLE**2)
        self._weight = _ROUGHNESS_MEMORY * self._weight + 1.0
        self._know((known + (variance - known) / self._weight).tolist())

    def _learn_from_gap(self, gap: Iterable[float], u: list[float]) -> None:
        """Learn the noise from how far a position is from where the velocities lead."""
        hardest, fastest = max(map(abs, u)) / _GENTLE, max(map(abs, self._numbers[1])) / _SLOW
        calm = 1.0 / (1.0 + hardest * hardest + fastest * fastest)
        weight = calm * calm
        self._weight = _GAP_MEMORY * self._weight + weight
        share = weight / (self._weight + 1.0)  # 1: the belief that there is none, to begin with
        kept, per_gap = 1 - share, share / self._gap_variance
        joints = zip(self._variance, gap)
        self._know([kept * known + per_gap * g * g for known, g in joints])

    def _know(self, variance: list[float]) -> None:
        self._variance, self.noise = variance, list(map(math.sqrt, variance))
        self.most_noise = max(self.noise)


@lru_cache(maxsize=16)
def _roughness(count: int) -> Array:
    """Return the projection of evenly spaced readings on what no smooth curve explains."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), _SMOOTH))
    return np.asarray(np.eye(count) - basis @ basis.T)

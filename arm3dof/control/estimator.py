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
_SLOW = (1.0, 0.3)  # [rad/s^2, rad/s]: motion in which a gap begins to tell less about noise


class StateEstimator:
    """Estimates the state of all joints, and how much of what happened was not expected.

    Attributes:
        q: estimated positions, shape (nv,) [rad].
        v: estimated velocities, shape (nv,) [rad/s].
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
        # a surprise is read from the most telling measurements: [q, v], or [mean, slope]
        self._telling = {2: (2 / dt**2, 1 / dt), 4: (6 / dt**2, 2 / dt)}
        self._readings, self._first_time = np.empty((_MOST, nv)), 0.0
        self._gap_variance = 2.0 + (VELOCITY_NOISE * dt) ** 2 / 2  # of noise of variance 1
        self.reset()

    @property
    def noise(self) -> list[float]:
        """Believed standard deviation of a measured position, of each joint [rad]."""
        return self._noise

    @property
    def most_noise(self) -> float:
        """The largest of them, over the joints [rad]."""
        return max(self._noise)

    def reset(self) -> None:
        """Forget the past."""
        self._noise = [self._given or 0.0] * self._nv
        self._variance, self._weight = [0.0] * self._nv, 0.0
        self.restart(JointState(0.0, np.zeros(self._nv), np.zeros(self._nv)))

    def restart(self, state: JointState) -> None:
        """Believe a measurement that does not follow from those before."""
        self.q, self.v = state.q, state.v
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

    def update(self, u: Array, gap: Iterable[float], state: JointState) -> list[float]:
        """Take in a measurement at the end of a sample.

        Args:
            u: expected acceleration since the last measurement, shape (nv,) [rad/s^2].
            gap: how far each measured position is from where the last one and the mean of the two
                measured velocities lead [rad].
            state: the measurement.

        Returns:
            Each joint's acceleration beyond ``u`` that is expected to last [rad/s^2].
        """
        # plain numbers, joint by joint: arrays this small cost more than what is done with them
        dt, half, readings, pushed = self._dt, self._dt / 2, self._sample(state), u.tolist()
        if self._given is None:
            if readings is None:
                self._learn_from_gap(gap, pushed)
            else:
                self._learn_from_roughness(readings)
        q_now, v_now = state.q.tolist(), state.v.tolist()
        sample = zip(self.q.tolist(), self.v.tolist(), pushed, q_now, v_now, strict=True)
        new = [(q1 - q - dt * (v + half * a), v1 - v - dt * a) for q, v, a, q1, v1 in sample]
        if max(self._noise) < _NEGLIGIBLE:
            self.q, self.v = state.q, state.v
            return [self._share * fast for _, fast in new]
        if readings is None:
            return self._filter(state, q_now, v_now, new, self._gains)
        seen = sensor(dt, len(readings))
        led = np.stack((q_now, v_now, pushed))
        led[:2] -= np.transpose(new)
        telling = (seen.summary @ readings - seen.of_state[2:] @ led).T.tolist()
        more = [(*own, *others) for own, others in zip(new, telling, strict=True)]
        table = gains(dt, self._learning, len(readings))
        return self._filter(state, q_now, v_now, more, table)

    def _filter(
        self,
        state: JointState,
        q_now: list[float],
        v_now: list[float],
        new: Sequence[tuple[float, ...]],
        table: Gains,
    ) -> list[float]:
        """Correct the estimate by what was not expected, and be surprised by it.

        Args:
            state: the measurement.
            q_now: its positions, of each joint [rad].
            v_now: its velocities [rad/s].
            new: innovations, of each joint that of its position, of its velocity, and others; the
                last two tell most of a surprise.
            table: what they are worth.

        Returns:
            Each joint's acceleration that is expected to last [rad/s^2].
        """
        edges, believes, per_sample = table.edges, True, self._dt**-2
        far, fast = self._telling[len(new[0])]
        positions, velocities, lasting, surprises = [], [], [], []
        joints = zip(q_now, v_now, new, self._noise, self._surprise, strict=True)
        for q, v, innovations, noise, surprise in joints:
            scale = noise * per_sample
            row = bisect_left(edges, scale / surprise)
            (spread, spread_rate), likely = table.telling[row], _SURPRISING * surprise
            distance = far * (abs(innovations[-2]) - likely * spread)
            speed = fast * (abs(innovations[-1]) - likely * spread_rate)
            if distance > surprise or speed > surprise:
                surprise = max(distance, speed)
                row = bisect_left(edges, scale / surprise)
            calmer = _CALMING * surprise
            surprises.append(calmer if calmer > _LEAST_SURPRISE else _LEAST_SURPRISE)
            if row == 0:  # it believes what is measured
                positions.append(q)
                velocities.append(v)
                lasting.append(self._share * innovations[1])
                continue
            believes = False
            to_q, to_v, to_lasting = table.gain[row]
            if len(innovations) == 2:  # the usual case, written out
                far_off, too_fast = innovations
                positions.append(q - far_off + to_q[0] * far_off + to_q[1] * too_fast)
                velocities.append(v - too_fast + to_v[0] * far_off + to_v[1] * too_fast)
                lasting.append(to_lasting[0] * far_off + to_lasting[1] * too_fast)
            else:
                positions.append(q - innovations[0] + sum(map(mul, to_q, innovations)))
                velocities.append(v - innovations[1] + sum(map(mul, to_v, innovations)))
                lasting.append(sum(map(mul, to_lasting, innovations)))
        self._surprise = surprises
        if believes:
            self.q, self.v = state.q, state.v
        else:
            self.q, self.v = np.array(positions), np.array(velocities)
        return lasting

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
        self._variance = (known + (variance - known) / self._weight).tolist()
        self._noise = list(map(math.sqrt, self._variance))

    def _learn_from_gap(self, gap: Iterable[float], u: list[float]) -> None:
        """Learn the noise from how far a position is from where the velocities lead."""
        hardest, fastest = max(map(abs, u)) / _SLOW[0], max(map(abs, self.v.tolist())) / _SLOW[1]
        weight = 1.0 / (1.0 + hardest * hardest + fastest * fastest) ** 2
        self._weight = _GAP_MEMORY * self._weight + weight
        share = weight / (self._weight + 1.0)  # 1: the belief that there is none, to begin with
        kept, per_gap = 1 - share, share / self._gap_variance
        joints = zip(self._variance, gap, strict=True)
        self._variance = [kept * known + per_gap * g * g for known, g in joints]
        self._noise = list(map(math.sqrt, self._variance))


@lru_cache(maxsize=16)
def _roughness(count: int) -> Array:
    """Return the projection of evenly spaced readings on what no smooth curve explains."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), _SMOOTH))
    return np.asarray(np.eye(count) - basis @ basis.T)

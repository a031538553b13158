"""The noise of joint encoders, on positions and on the velocities that are derived from them."""

from __future__ import annotations

import math

import numpy as np

from arm3dof.errors import InputError
from arm3dof.state import Array


class EncoderNoise:
    """White noise on positions, and its smoothed derivative on velocities.

    A drive differentiates its encoder and smooths the result, here by a critically damped filter
    of second order (two equal first-order ones). So the velocity errs by the smoothed derivative
    of the position's error: the two errors belong together, and the velocity's lasts about as
    long as the filter's time constant T. The lag that the filter would add to the true velocity
    is left out. With position noise sigma and readings every dt the velocity errs by

        sigma b sqrt(2 (1 - a) / (1 + a)^3),  a = exp(-dt / T),  b = (1 - a) / dt,

    which is about sigma sqrt(dt / T) / (2 T).

    Attributes:
        q: present error of the positions, shape (nv,) [rad].
        v: present error of the velocities, shape (nv,) [rad/s].
    """

    def __init__(
        self, sigma: Array, dt: float, time_constant: float, rng: np.random.Generator
    ) -> None:
        """Draw the first errors, as they are when the drive has been running for long.

        Args:
            sigma: standard deviation of the positions' errors, shape (nv,) [rad].
            dt: time between two readings [s].
            time_constant: T, of each of the two filters [s].
            rng: source of the noise.

        Raises:
            InputError: the time constant is not positive, or a sigma is negative or not finite.
        """
        if not (math.isfinite(time_constant) and time_constant > 0):
            raise InputError(f"velocity_filter is {time_constant!r}; give a time above 0 s")
        if not (np.isfinite(sigma).all() and (sigma >= 0).all()):
            raise InputError(f"noise is {sigma}; give standard deviations of 0 or more radians")
        self._sigma, self._rng = sigma, rng
        self._a = math.exp(-dt / time_constant)
        self._b = (1 - self._a) / dt
        self.restart()

    def restart(self) -> None:
        """Draw new first errors."""
        # The first filter's output splits into its newest input b n(k) and a memory z(k) of all
        # before, z(k+1) = a z(k) - b (1 - a) n(k). These are the lasting variance of z and the
        # lasting distribution, given z, of the velocity's error one reading ago.
        a, b = self._a, self._b
        self._memory = b * math.sqrt((1 - a) / (1 + a)) * self._draw()
        rest = b * math.sqrt((1 - a) / (1 + a) ** 3) * self._draw()
        self.v = rest - self._memory / (1 + a)
        self._read()

    def advance(self) -> None:
        """Go on to the next reading."""
        self._memory = self._a * self._memory - self._b * (1 - self._a) * self.q
        self._read()

    def _read(self) -> None:
        self.q = self._draw()
        derivative = self._b * self.q + self._memory
        self.v = self._a * self.v + (1 - self._a) * derivative

    def _draw(self) -> Array:
        return self._sigma * self._rng.standard_normal(self._sigma.size)


class EncoderError:
    """What an encoder of finite resolution errs by, with noise if wished.

    It tells the whole step nearest to position plus noise. A drive differentiates what it is told
    and smooths it by two first-order filters; so the velocity errs by the smoothed derivative of
    the position's error, and the lag that the filters would add to the true velocity is left out,
    as in ``EncoderNoise``.
    """

    def __init__(
        self,
        resolution: Array,
        sigma: Array,
        dt: float,
        time_constant: float,
        rng: np.random.Generator | None,
    ) -> None:
        """Create an encoder; ``restart`` places it.

        Args:
            resolution: step of each joint, shape (nv,) [rad]; 0 for a continuous one.
            sigma: standard deviation of the noise, shape (nv,) [rad].
            dt: time between two readings [s].
            time_constant: of each of the two filters [s].
            rng: source of the noise.

        Raises:
            InputError: there is noise without ``rng``.
        """
        if rng is None and sigma.any():
            raise InputError("noise needs a source: give rng=numpy.random.default_rng(seed)")
        self._resolution, self._sigma, self._rng = resolution, sigma, rng
        self._steps = np.where(resolution > 0, resolution, 1.0)
        self._perfect = not (resolution.any() or sigma.any())
        self._dt, self._keep = dt, math.exp(-dt / time_constant)

    def restart(self, position: Array) -> None:
        """Begin at a position, shape (nv,) [rad], at which the drive has stood for long."""
        self._smooth = self._told(position) - position
        self._v = np.zeros(position.size)

    def read(self, position: Array) -> tuple[Array, Array]:
        """Return the next reading of a position, and the error of the velocity; (nv,) each."""
        if self._perfect:
            return position, self._v
        told = self._told(position)
        before = self._smooth
        self._smooth = self._keep * before + (1 - self._keep) * (told - position)
        slope = (self._smooth - before) / self._dt
        self._v = self._keep * self._v + (1 - self._keep) * slope
        return told, self._v

    def _told(self, position: Array) -> Array:
        noisy = position
        if self._rng is not None and self._sigma.any():
            noisy = position + self._sigma * self._rng.standard_normal(position.size)
        whole = np.round(noisy / self._steps) * self._steps
        return np.where(self._resolution > 0, whole, noisy)

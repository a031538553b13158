"""The noise of joint encoders, on positions and on the velocities that are derived from them."""

from __future__ import annotations

import math

import numpy as np

from arm3dof.errors import InputError
from arm3dof.state import Array


class EncoderNoise:
    """White noise on positions, and its filtered derivative on velocities.

    A drive differentiates its encoder and smooths the result. Its velocity therefore errs by the
    derivative of the position's error behind a first-order filter: errors of the two belong
    together, and a velocity's error lasts about as long as the filter's time constant. The lag
    that such a filter would add to the true velocity is left out. With position noise sigma the
    velocity errs by about sigma / time_constant, exactly sigma b sqrt(2 / (1 + a)) with
    a = exp(-dt / time_constant) and b = (1 - a) / dt.

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
            time_constant: of the filter behind the differentiator [s].
            rng: source of the noise.

        Raises:
            InputError: the time constant is not positive, or a sigma is negative or not finite.
        """
        if not (math.isfinite(time_constant) and time_constant > 0):
            raise InputError(f"velocity_filter is {time_constant!r}; give a time above 0 s")
        if not (np.isfinite(sigma).all() and (sigma >= 0).all()):
            raise InputError(f"noise is {sigma}; give standard deviations of 0 or more radians")
        self._sigma, self._rng = sigma, rng
        self._keep = math.exp(-dt / time_constant)  # a
        self._gain = (1 - self._keep) / dt  # b
        self.restart()

    def restart(self) -> None:
        """Draw new first errors."""
        # The filter's output b n(k) + z(k) splits into the newest noise n and a memory z of all
        # before, z(k+1) = a z(k) - b (1 - a) n(k), whose lasting variance is b^2 (1-a)/(1+a).
        spread = self._gain * math.sqrt((1 - self._keep) / (1 + self._keep))
        self._memory = spread * self._draw()
        self._read()

    def advance(self) -> None:
        """Go on to the next reading."""
        self._memory = self._keep * self._memory - self._gain * (1 - self._keep) * self.q
        self._read()

    def _read(self) -> None:
        self.q = self._draw()
        self.v = self._gain * self.q + self._memory

    def _draw(self) -> Array:
        return self._sigma * self._rng.standard_normal(self._sigma.size)

"""Keeping time: wake at due times of an absolute clock, and know how late each wake-up was."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np


class Clock(Protocol):
    """A clock to wait on."""

    def now(self) -> float:
        """Return the time [s]."""

    def wait_until(self, due: float) -> None:
        """Return at a time [s], or at once when it is past."""


class WallClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait_until(self, due: float) -> None:
        """Sleep until a time [s]."""
        left = due - time.monotonic()
        if left > 0:
            time.sleep(left)


class SimulatedClock:
    """A clock that jumps to whatever is waited for: an hour passes in seconds."""

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """Return the time [s]."""
        return self._now

    def wait_until(self, due: float) -> None:
        """Let time pass until then."""
        self._now = max(self._now, due)


class Pacer:
    """Due times counted from one start, so that no error adds up.

    Attributes:
        missed: how many due times were over before they could be waited for.
    """

    def __init__(self, clock: Clock) -> None:
        """Start now."""
        self.missed = 0
        self._clock = clock
        self._due = clock.now()

    def wait(self, duration: float) -> float:
        """Sleep until ``duration`` after the last due time; return how late the wake-up was [s].

        Work that ran past its due time is not caught up on: it counts as missed, and time is
        counted anew from here.
        """
        self._due += duration
        now = self._clock.now()
        if now > self._due:
            self.missed += 1
            late, self._due = now - self._due, now
            return late
        self._clock.wait_until(self._due)
        return max(self._clock.now() - self._due, 0.0)


def lateness_percentiles(lateness: np.ndarray) -> dict[str, float]:
    """Return p50, p99 and the largest of some latenesses [s]; zeros for none."""
    if lateness.size == 0:
        return {"p50": 0.0, "p99": 0.0, "max": 0.0}
    p50, p99 = np.percentile(lateness, [50, 99])
    return {"p50": float(p50), "p99": float(p99), "max": float(lateness.max())}

"""Timing several contestants in turns, so that the machine's moods strike all of them alike."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import wraps
from time import perf_counter
from typing import Any

import numpy as np

from arm3dof.state import Array
from benchmarks.contestants import Contestant

_FEWEST_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Timing:
    """Times of one contestant: the same steps, once a round.

    Attributes:
        times: shape (rounds, steps) [s]; the first step of a motion, which starts cold, is not in.
    """

    times: Array

    @property
    def p50(self) -> float:
        """Median over all rounds and steps [s]."""
        return float(np.median(self.times))

    @property
    def p99(self) -> float:
        """99th percentile over all rounds and steps [s]: whatever else the machine did is in."""
        return float(np.percentile(self.times, 99))

    @property
    def calm_p50(self) -> float:
        """Median over the steps, each in its best round [s]."""
        return float(np.median(self.times.min(axis=0)))

    @property
    def calm_p99(self) -> float:
        """99th percentile over the steps, each in its best round [s]: the work alone."""
        return float(np.percentile(self.times.min(axis=0), 99))

    @property
    def spread(self) -> float:
        """p99 by p50 of a round, the median over the rounds; a round is too short for moods."""
        p50, p99 = np.percentile(self.times, [50, 99], axis=1)
        return float(np.median(p99 / p50))

    def ratio(self, other: Timing) -> float:
        """Return the median over the rounds of our median time by the other's."""
        rounds = min(len(self.times), len(other.times))
        ours, theirs = (np.median(t.times[:rounds], axis=1) for t in (self, other))
        return float(np.median(ours / theirs))

    def to_dict(self) -> dict[str, float]:
        """Return the figures, times in microseconds."""
        names = ("p50", "p99", "calm_p50", "calm_p99")
        times = {f"{name}_us": round(1e6 * float(getattr(self, name)), 1) for name in names}
        return times | {"spread": round(self.spread, 3)}


def take_turns(
    contestants: Mapping[str, Contestant], motions: int, most: int, budget: float
) -> dict[str, Timing]:
    """Time every contestant on every motion, in an order that changes from motion to motion.

    Args:
        contestants: who is timed.
        motions: number of motions.
        most: how often a contestant does all motions, at most.
        budget: time that it may take [s]; a slow one does them less often, twice at least.
    """
    names = list(contestants)
    times: dict[str, list[Array]] = {name: [] for name in names}
    rounds = {}
    for name in names:
        once = motions * float(contestants[name].times(0).sum())  # which warms caches, too
        rounds[name] = min(most, max(_FEWEST_ROUNDS, int(budget / once)))
    for turn in range(max(rounds.values())):
        asked = [name for name in names if turn < rounds[name]]
        found: dict[str, list[Array]] = {name: [] for name in asked}
        for motion in range(motions):
            for name in asked if (turn + motion) % 2 else reversed(asked):
                found[name].append(contestants[name].times(motion)[1:])
        for name, parts in found.items():
            times[name].append(np.concatenate(parts))
    return {name: Timing(np.array(rows)) for name, rows in times.items()}


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process, and those that it starts, on one core: cores may differ in their pace.

    Where the system cannot do that nothing is done.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


class Stopwatch:
    """Adds up the time that is spent inside some methods and functions."""

    def __init__(self, parts: Mapping[str, tuple[object, str]]) -> None:
        """Create a stopwatch.

        Args:
            parts: the class or module that has each, and its name there, by what its share is
                called; one may run inside another.
        """
        self._parts = parts
        self._seconds = dict.fromkeys(parts, 0.0)

    def lap(self) -> dict[str, float]:
        """Return the time spent in each method since the last lap [s]."""
        lap, self._seconds = self._seconds, dict.fromkeys(self._parts, 0.0)
        return lap

    @contextmanager
    def running(self) -> Iterator[None]:
        """Measure until the block ends; the methods are as before after it."""
        with ExitStack() as stack:
            for part, (owner, name) in self._parts.items():
                stack.enter_context(self._timed(part, owner, name))
            yield

    @contextmanager
    def _timed(self, part: str, owner: object, name: str) -> Iterator[None]:
        method = getattr(owner, name)

        @wraps(method)
        def timed(*args: Any, **kwargs: Any) -> Any:
            start = perf_counter()
            try:
                return method(*args, **kwargs)
            finally:
                self._seconds[part] += perf_counter() - start

        setattr(owner, name, timed)
        try:
            yield
        finally:
            setattr(owner, name, method)

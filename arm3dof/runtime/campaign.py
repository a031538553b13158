"""Campaigns: one trial many times over, each with its own random numbers, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from arm3dof.errors import ArmError, InputError
from arm3dof.runtime.journal import Journal, code_fingerprint, fingerprint
from arm3dof.runtime.parallel import Progress, run_all
from arm3dof.state import Array

Figures = Mapping[str, float | Sequence[float]]


@dataclass(frozen=True)
class Outcome:
    """What came of one trial.

    Attributes:
        reason: why it failed, in a few words; empty when it succeeded.
        figures: what was measured, by name with the unit in it: a number, or some.
    """

    reason: str = ""
    figures: Figures = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether the trial succeeded."""
        return not self.reason


Trial = Callable[[np.random.Generator], Outcome]
"""One trial; everything random in it comes from the generator.

It is a function at the top of a module, or an instance of a frozen dataclass with ``__call__``
whose fields say all that the outcome depends on; either can be sent to another process.
"""


@dataclass(frozen=True)
class Campaign:
    """The outcomes of all trials.

    Attributes:
        outcomes: by the trial's number.
        wall_s: how long it took [s].
        reused: how many outcomes were taken from an earlier run's journal.
    """

    outcomes: Mapping[int, Outcome]
    wall_s: float
    reused: int = 0

    @property
    def successes(self) -> int:
        """How many trials succeeded."""
        return sum(outcome.success for outcome in self.outcomes.values())

    @property
    def success_rate(self) -> float:
        """Share of the trials that succeeded."""
        return self.successes / len(self.outcomes)

    @property
    def failures(self) -> tuple[tuple[int, str], ...]:
        """Number and reason of each trial that failed, in order."""
        outcomes = sorted(self.outcomes.items())
        return tuple((number, it.reason) for number, it in outcomes if not it.success)

    def column(self, name: str) -> Array:
        """Return one figure of all trials that have it, end to end, shape (n,)."""
        parts = [
            np.atleast_1d(np.asarray(outcome.figures[name], dtype=np.float64))
            for _, outcome in sorted(self.outcomes.items())
            if name in outcome.figures
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def report(self) -> dict[str, Any]:
        """Return the campaign as plain names and values."""
        return {
            "success_rate": self.success_rate,
            "successes": self.successes,
            "n": len(self.outcomes),
            "failures": [{"trial": trial, "reason": reason} for trial, reason in self.failures],
            "wall_s": self.wall_s,
        }


def run_campaign(
    trial: Trial,
    n: int,
    seed: int,
    *,
    only: Sequence[int] = (),
    journal: Path | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> Campaign:
    """Run a trial many times.

    An ``ArmError`` in a trial is a failure with the error as its reason.

    Args:
        trial: the trial.
        n: how many.
        seed: decides the random numbers of all of them, together with each one's number.
        only: numbers of the trials to run, below ``n``; all without it.
        journal: JSON-lines file to which each outcome is added as soon as it is known. A trial
            whose outcome it holds already, for the same code, trial and seed, is not run again.
        workers: number of processes, see ``run_all``.
        progress: told of each finished trial.

    Raises:
        InputError: a number is out of range, or the journal is none or cannot be written.
    """
    if n < 1:
        raise InputError(f"n is {n}; give 1 or more trials")
    if seed < 0:
        raise InputError(f"seed is {seed}; give 0 or more")
    if wrong := [number for number in only if not 0 <= number < n]:
        raise InputError(f"there is no trial {wrong[0]}; give numbers from 0 to {n - 1}")
    start = perf_counter()
    known, facts = Journal(journal), _facts(trial)
    keys = {number: fingerprint(facts, seed, number) for number in only or range(n)}
    missing = [number for number, key in keys.items() if key not in known]
    tasks = [(trial, seed, number) for number in missing]
    for index, outcome in run_all(_run, tasks, workers=workers, progress=progress):
        number = missing[index]
        known.add(keys[number], {"trial": number, **asdict(outcome)})
    outcomes = {
        number: Outcome(known[key]["reason"], known[key]["figures"]) for number, key in keys.items()
    }
    return Campaign(outcomes, perf_counter() - start, len(keys) - len(missing))


def trial_rng(seed: int, number: int) -> np.random.Generator:
    """Return the random numbers of one trial of a campaign."""
    return np.random.default_rng([seed, number])


def _run(task: tuple[Trial, int, int]) -> Outcome:
    trial, seed, number = task
    try:
        return trial(trial_rng(seed, number))
    except ArmError as error:
        return Outcome(str(error))


def _facts(trial: Trial) -> list[object]:
    """Return all that a trial's outcome depends on but its random numbers."""
    kind = trial if hasattr(trial, "__qualname__") else type(trial)
    settings: dict[str, object] = {}
    if is_dataclass(trial) and not isinstance(trial, type):
        settings = asdict(trial)
    return [code_fingerprint(), f"{kind.__module__}.{kind.__qualname__}", settings]

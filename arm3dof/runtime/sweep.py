"""What a setting of the controller does: the paper's experiment once for each of many values."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.control.settings import MpcSettings
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.experiment import (
    PAPER_DURATION,
    default_start,
    default_target,
    simulate,
)
from arm3dof.runtime.journal import fingerprint
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.parallel import PackedRobot, Progress, run_all
from arm3dof.runtime.sweep_table import SweepTable
from arm3dof.state import Array

Value = float | int | str

_WHOLE = ("horizon", "max_iterations")
_WORDS = ("formulation", "discretisation")
_FIELDS = ("input_weight", "dt", "observer_gain", "delay", "limit_weight", "tolerance")
_WEIGHTS = ("position_weight", "velocity_weight", "terminal_weight")

KNOBS = (*_WEIGHTS, *_FIELDS, *_WHOLE, *_WORDS)
"""What can be varied: fields of ``MpcSettings``, and the parts of its weights.

``position_weight`` and ``velocity_weight`` are the two numbers of ``state_weight``, Q;
``terminal_weight`` is the position's number in P, with zero for the velocity.
"""


@dataclass(frozen=True)
class Vary:
    """A setting and the values that it takes in turn.

    Attributes:
        name: one of ``KNOBS``.
        values: its values, at least one.

    Raises:
        InputError: the name is unknown or there is no value.
    """

    name: str
    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        if self.name not in KNOBS:
            raise InputError(f"no setting '{self.name}' to vary; give one of: {', '.join(KNOBS)}")
        if not self.values:
            raise InputError(f"{self.name} has no value; give at least one")

    @staticmethod
    def parse(text: str) -> Vary:
        """Read ``NAME=LOW:HIGH:COUNT``, spaced evenly on a log scale, or ``NAME=A,B,C``.

        Raises:
            InputError: the text is neither, or a value is none of its setting's.
        """
        name, equals, spec = (part.strip() for part in text.partition("="))
        what = f"'{text}'"
        if not equals or not spec:
            raise InputError(f"{what}: write NAME=LOW:HIGH:COUNT or NAME=A,B,C")
        if ":" in spec:
            return Vary(name, _range(name, spec, what))
        return Vary(name, tuple(_value(name, part.strip(), what) for part in spec.split(",")))


@dataclass(frozen=True)
class Point:
    """One run of a sweep.

    Attributes:
        family: the runs that belong together, drawn as one line.
        label: what is special about this one.
        settings: the controller's settings.
    """

    family: str
    label: str
    settings: MpcSettings


@dataclass(frozen=True)
class Outcome:
    """What a point achieved.

    Attributes:
        point: the point.
        values: figures of merit by name, with the unit in each name.
    """

    point: Point
    values: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Sweep:
    """All outcomes, in the order of their points.

    Attributes:
        outcomes: one a point.
        reused: how many were taken from the table of an earlier sweep.
    """

    outcomes: tuple[Outcome, ...]
    reused: int

    def column(self, name: str) -> Array:
        """Return one figure of merit of all outcomes, shape (n,); NaN where there is none."""
        values = [outcome.values[name] for outcome in self.outcomes]
        return np.array([np.nan if value is None else value for value in values])

    def front(self, cost: str = "energy_j", error: str = "rms_error_rad") -> NDArray[np.bool_]:
        """Return which outcomes no other beats in both figures of merit, shape (n,)."""
        return pareto_front(self.column(cost), self.column(error))


def default_points(base: MpcSettings | None = None) -> tuple[Point, ...]:
    """Return the sweep that shows what Q, R and P do.

    R and the velocity's part of Q are varied about ``base``. P speaks only when the horizon ends
    before the arm has arrived, so it is varied with a horizon of 3.
    """
    base = base or MpcSettings()
    short = replace(base, horizon=3, blocks=None)
    return (
        *_family("R: input weight", base, Vary.parse("input_weight=1e-6:1e-2:9")),
        *_family("Q: velocity weight", base, Vary.parse("velocity_weight=1e-3:0.3:8")),
        *_family("P: terminal weight, N = 3", short, Vary.parse("terminal_weight=0.1:100:7")),
    )


def points(varied: Sequence[Vary], base: MpcSettings | None = None) -> tuple[Point, ...]:
    """Return the points of a sweep over one setting, or over the grid of two.

    Args:
        varied: one or two settings; each value of the second makes a family.
        base: every other setting.

    Raises:
        InputError: there are none or more than two, one twice, or a value is outside its domain.
    """
    base = base or MpcSettings()
    if not 1 <= len({vary.name for vary in varied}) == len(varied) <= 2:
        raise InputError("vary one setting, or two different ones")
    if len(varied) == 1:
        return _family(varied[0].name, base, varied[0])
    first, second = varied
    return tuple(
        point
        for value in second.values
        for point in _family(
            f"{second.name} = {_text(value)}", with_value(base, second.name, value), first
        )
    )


def sweep(
    robot: Robot,
    chosen: Sequence[Point],
    *,
    start: ArrayLike | None = None,
    target: ArrayLike | None = None,
    duration: float = PAPER_DURATION,
    table: Path | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> Sweep:
    """Run the paper's experiment at each point.

    Args:
        robot: the robot.
        chosen: the points.
        start: joint positions at rest, shape (nv,) [rad]; ``default_start`` when ``None``.
        target: joint positions to reach, shape (nv,) [rad]; ``default_target`` when ``None``.
        duration: length of a run [s].
        table: CSV file to which each outcome is added as soon as it is known. Points whose
            outcome it holds already, for the same robot and motion, are not run again.
        workers: number of processes, see ``run_all``.
        progress: told of each finished run.

    Raises:
        InputError: the table is none of a sweep, or cannot be written.
    """
    begin = default_start(robot) if start is None else np.asarray(start, float)
    end = default_target(robot, begin) if target is None else np.asarray(target, float)
    packed = PackedRobot.of(robot)
    motion = (begin.tolist(), end.tolist(), float(duration))
    keys = [_key(packed, motion, point.settings) for point in chosen]
    known = SweepTable(table)
    missing = {key: point for key, point in zip(keys, chosen, strict=True) if key not in known}
    tasks = [(packed, motion, point.settings) for point in missing.values()]
    for index, values in run_all(_run, tasks, workers=workers, progress=progress):
        key = list(missing)[index]
        known.add(key, {**_setting_columns(missing[key].settings), **values})
    outcomes = tuple(
        Outcome(point, known.figures(key)) for key, point in zip(keys, chosen, strict=True)
    )
    return Sweep(outcomes, len(set(keys)) - len(missing))


def with_value(base: MpcSettings, name: str, value: Value) -> MpcSettings:
    """Return settings with one of ``KNOBS`` changed.

    Raises:
        InputError: the value is outside its domain.
    """
    if name == "terminal_weight":
        return replace(base, terminal_weight=(value, 0.0))
    if name in _WEIGHTS:
        weights = np.asarray(base.state_weight, float)
        if weights.shape != (2,):
            raise InputError(f"{name} cannot be varied: state_weight is not two numbers")
        position, velocity = weights.tolist()
        both = (value, velocity) if name == "position_weight" else (position, value)
        return replace(base, state_weight=both)
    changes: dict[str, Any] = {name: value}
    if name == "horizon":
        changes["blocks"] = None
    return replace(base, **changes)


def pareto_front(first: ArrayLike, second: ArrayLike) -> NDArray[np.bool_]:
    """Return which pairs no other pair beats: as low in both and lower in one, shape (n,).

    A pair with a NaN is never on the front.
    """
    pairs = np.stack([np.asarray(first, float), np.asarray(second, float)], axis=1)
    valid = np.isfinite(pairs).all(axis=1)
    on_front: NDArray[np.bool_] = valid.copy()
    for index in np.flatnonzero(valid):
        as_low = (pairs <= pairs[index]).all(axis=1)
        lower = (pairs < pairs[index]).any(axis=1)
        on_front[index] = not (as_low & lower & valid).any()
    return on_front


def _family(name: str, base: MpcSettings, vary: Vary) -> tuple[Point, ...]:
    return tuple(
        Point(name, _text(value), with_value(base, vary.name, value)) for value in vary.values
    )


def _run(
    task: tuple[PackedRobot, tuple[list[float], list[float], float], MpcSettings],
) -> dict[str, float | None]:
    packed, (start, target, duration), settings = task
    robot = packed.unpack()
    metrics = summarise(simulate(robot, start, target, settings=settings, duration=duration))
    return {
        "settling_time_s": metrics.settling_time,
        "rms_error_rad": metrics.rms_error,
        "final_error_rad": metrics.final_error,
        "energy_j": metrics.energy,
        "torque_squared_n2m2s": metrics.torque_squared,
        "peak_torque_nm": metrics.peak_torque,
        "saturation": metrics.saturation,
        "violations": float(
            metrics.torque_violations + metrics.velocity_violations + metrics.position_violations
        ),
        "step_time_p50_s": metrics.step_time_p50,
    }


def _key(packed: PackedRobot, motion: tuple[Any, ...], settings: MpcSettings) -> str:
    """Return what tells one run from another: all that it depends on, as a short hash."""
    return fingerprint(version("arm3dof"), asdict(packed), motion, _setting_columns(settings))


def _setting_columns(settings: MpcSettings) -> dict[str, str]:
    """Return every setting as text, exactly."""
    values = {entry.name: getattr(settings, entry.name) for entry in fields(settings)}
    return {
        name: value
        if isinstance(value, str)
        else json.dumps(np.asarray(value).tolist() if value is not None else None)
        for name, value in values.items()
    }


def _range(name: str, spec: str, what: str) -> tuple[Value, ...]:
    parts = [part.strip() for part in spec.split(":")]
    if len(parts) != 3 or name in _WORDS:
        raise InputError(f"{what}: write NAME=LOW:HIGH:COUNT, for example input_weight=1e-4:1e-2:9")
    low, high = (_number(part, what) for part in parts[:2])
    if not (low > 0 and high > 0 and parts[2].isdecimal() and int(parts[2]) >= 2):
        raise InputError(f"{what}: LOW and HIGH must be above 0 and COUNT 2 or more")
    values = [float(f"{value:.4g}") for value in np.geomspace(low, high, int(parts[2]))]
    if name in _WHOLE:
        return tuple(dict.fromkeys(round(value) for value in values))
    return tuple(values)


def _value(name: str, text: str, what: str) -> Value:
    if name in _WORDS:
        return text
    value = _number(text, what)
    if name not in _WHOLE:
        return value
    if value != int(value):
        raise InputError(f"{what}: {name} takes whole numbers, not {text}")
    return int(value)


def _number(text: str, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{what}: '{text}' is no number") from None
    if not np.isfinite(value):
        raise InputError(f"{what}: {text} is not finite")
    return value


def _text(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"

"""A recording as what the report's page shows beside the replay: charts, statuses and tables."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

import arm3dof
from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import Metrics
from arm3dof.runtime.recording import Recording
from arm3dof.ui.meshcat_window import Command
from arm3dof.ui.pictures import data_url
from arm3dof.ui.quantities import QUANTITIES, Quantity, extreme_rows
from arm3dof.ui.replay import is_turning
from arm3dof.ui.shapes import typed_array
from arm3dof.ui.style import COLORS, DARK_COLORS

MAX_ROWS = 6000  # of a curve in the file; of a longer one the extremes are kept
_PHASE_NAME = re.compile(r"task\.\d+ (.+)")
_PHASE_END = re.compile(r"until ([\d.]+) s: (.+)", re.DOTALL)

Table = Mapping[str, object]


class Stretch(NamedTuple):
    """A part of a run with a name.

    Attributes:
        start: time since the start of the run [s].
        end: likewise [s].
        name: in a word or two.
        sentence: more about it.
        level: 0 for an optimum, 1 where a limit was softened, 2 for the last plan, 3 for braking.
    """

    start: float
    end: float
    name: str
    sentence: str = ""
    level: int = 0


def report_command(
    recording: Recording, robot: Robot, metrics: Metrics, picture: bytes | None = None
) -> Command:
    """Return the command that shows a run's charts, statuses and tables.

    Args:
        recording: the run.
        robot: its robot.
        metrics: its figures of merit.
        picture: a PNG, JPEG or WebP file to show.

    Raises:
        InputError: the picture is of another kind, or too large.
    """
    r = recording
    return {
        "type": "report",
        "joints": list(r.joint_names),
        "duration": float(r.t[-1] - r.t[0]),
        "settled": metrics.settling_time,
        "colours": {
            "light": _cycled(COLORS, robot),
            "dark": _cycled(DARK_COLORS, robot),
        },
        "charts": [_chart(r, quantity(r)) for quantity in QUANTITIES],
        "segments": [each._asdict() for each in status_segments(r)],
        "kinds": _status_kinds(r),
        "phases": [each._asdict() for each in task_phases(r)],
        "tables": [_run_table(r, robot), _joint_table(r, robot), *_note_tables(r)],
        "picture": None if picture is None else data_url(picture),
    }


def status_segments(recording: Recording) -> list[Stretch]:
    """Return the stretches of time in which the controller said the same, in order."""
    r = recording
    code = r.status.astype(int) * 16 + r.source
    starts = np.flatnonzero(np.diff(code, prepend=-1))
    ends = np.append(starts[1:], len(r) - 1)
    return [
        Stretch(
            float(r.t[start] - r.t[0]),
            float(r.t[end] - r.t[0]),
            _name(r.status[start], r.source[start]),
            level=status_level(r.status[start], r.source[start]),
        )
        for start, end in zip(starts, ends, strict=True)
    ]


def task_phases(recording: Recording) -> list[Stretch]:
    """Return the phases of a task that the notes tell of, in order; none for any other run."""
    phases: list[Stretch] = []
    for key, note in recording.notes.items():
        name, told = _PHASE_NAME.fullmatch(key), _PHASE_END.fullmatch(note)
        if name and told:
            begun = phases[-1].end if phases else 0.0
            phases.append(Stretch(begun, float(told[1]), name[1], told[2]))
    return phases


# ---- parts ---------------------------------------------------------------------------------------


def _chart(r: Recording, quantity: Quantity) -> dict[str, object]:
    limits = None if quantity.limits is None else [_finite(limit) for limit in quantity.limits]
    series = []
    for column in quantity.values.T:
        rows = extreme_rows(np.nan_to_num(column), MAX_ROWS)
        times = (r.t[rows] - r.t[0]).astype(np.float32)
        series.append({"t": typed_array(times), "v": typed_array(column[rows].astype(np.float32))})
    return {
        "title": quantity.title,
        "label": quantity.label,
        "unit": quantity.unit,
        "band": quantity.band,
        "must_show_limit": quantity.must_show_limit,
        "limits": limits,
        "series": series,
    }


def _status_kinds(r: Recording) -> list[dict[str, object]]:
    rows = r.control_rows
    pairs, counts = np.unique(
        np.column_stack([r.status[rows], r.source[rows]]), axis=0, return_counts=True
    )
    return [
        {
            "name": _name(status, source),
            "level": status_level(status, source),
            "count": int(count),
            "sentence": status_sentence(status, source),
        }
        for (status, source), count in zip(pairs, counts, strict=True)
    ]


def _run_table(r: Recording, robot: Robot) -> Table:
    description = r.robot
    period = float(r.t[1] - r.t[0]) if len(r) > 1 else r.control_dt
    rows = [
        ("Robot", f"{robot.name} ({description.source})"),
        ("Tool frame", r.tool_frame),
        ("Gravity", f"({', '.join(f'{g:g}' for g in description.gravity)}) m/s²"),
        ("Payload", "none" if description.payload is None else f"{description.payload.mass:g} kg"),
        ("Length", f"{r.t[-1] - r.t[0] + period:.3g} s, {len(r)} rows of {1e3 * period:.3g} ms"),
        ("Control period", f"{1e3 * r.control_dt:.4g} ms, {int(r.control_rows.sum())} steps"),
        ("Written by", f"arm3dof {arm3dof.__version__}"),
    ]
    return {"title": "Run", "head": None, "rows": rows}


def _joint_table(r: Recording, robot: Robot) -> Table:
    rows = []
    for joint, name in enumerate(r.joint_names):
        turns = is_turning(robot, joint)
        scale, unit, rate, effort = (
            (180 / np.pi, "°", "rad/s", "N m") if turns else (1000.0, "mm", "m/s", "N")
        )
        low, high = scale * r.limits.q_min[joint], scale * r.limits.q_max[joint]
        reach = f"{low:.0f} … {high:.0f} {unit}" if np.isfinite(high - low) else "free"
        rows.append(
            (
                name,
                f"{scale * r.q[0, joint]:.1f} {unit}",
                f"{scale * r.q_target[joint]:.1f} {unit}",
                reach,
                f"{r.limits.v_max[joint]:g} {rate}",
                f"{r.limits.tau_max[joint]:g} {effort}",
            )
        )
    head = ("joint", "start", "target", "range", "speed ≤", "torque ≤")
    return {"title": "Joints", "head": head, "rows": rows}


def _note_tables(r: Recording) -> list[Table]:
    """Return the notes, those of one subject (``subject.name``) in one table."""
    subjects: dict[str, list[tuple[str, str]]] = {}
    for key, value in r.notes.items():
        subject, _, name = key.rpartition(".")
        shown = f"{value} {_UNITS[key]}" if key in _UNITS else value
        subjects.setdefault(subject, []).append((name.replace("_", " "), shown))
    return [
        {"title": _SUBJECTS.get(subject, subject), "head": None, "rows": rows}
        for subject, rows in subjects.items()
    ]


_SUBJECTS = {"": "Notes", "mpc": "Controller", "task": "Task"}
_UNITS = {
    "mpc.horizon": "stages",
    "mpc.dt": "s",
    "mpc.delay": "s",
    "mpc.torque_rate": "N m/s",
    "mpc.max_step_time": "s",
    "mpc.plan_validity": "s",
    "payload_kg": "kg",
    "model_error": "%",
    "noise_deg": "deg",
    "delay_ms": "ms",
}

_NAMES = {
    ControlStatus.SOLVED: "optimal",
    ControlStatus.SOFTENED: "limit softened",
    ControlStatus.NOT_SOLVED: "no optimum",
    ControlStatus.DEADLINE_MISSED: "too late",
    ControlStatus.BAD_MEASUREMENT: "bad measurement",
    ControlStatus.BAD_TARGET: "bad target",
}
_SOURCES = {TorqueSource.PREVIOUS_PLAN: ": last plan", TorqueSource.BRAKING: ": braking"}


def _name(status: int, source: int) -> str:
    return _NAMES[ControlStatus(status)] + _SOURCES.get(TorqueSource(source), "")


def status_sentence(status: int, source: int) -> str:
    """Return a control step's status and source in plain words."""
    said = ControlStatus(status).sentence
    if source == TorqueSource.OPTIMUM:
        return said
    return f"{said}; instead: {TorqueSource(source).sentence}"


def status_level(status: int, source: int) -> int:
    """Return 0 for an optimum, 1 where a limit was softened, 2 for the last plan, 3 for braking."""
    if source != TorqueSource.OPTIMUM:
        return 1 + int(source)
    return 0 if status == ControlStatus.SOLVED else 1


def _cycled(colours: tuple[str, ...], robot: Robot) -> list[str]:
    return list(itertools.islice(itertools.cycle(colours), robot.nv))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

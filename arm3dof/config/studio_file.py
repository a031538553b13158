"""STUDIO.toml: what was tuned in the studio, to begin with it another time.

The tables are ``[robot]`` with ``[robot.overrides]``, and ``[control]`` with ``[control.mpc]`` and,
for PD and PID, ``[control.gains]``. Everything is in SI units, and what a file leaves out is as it
comes.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from arm3dof.config.explain import explain
from arm3dof.control.settings import Discretisation, Formulation
from arm3dof.control.tuning import Gains
from arm3dof.errors import InputError
from arm3dof.files import unreadable, write_atomically
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.tuned import Tuned

Finite = Annotated[float, Field(allow_inf_nan=False)]
Weight = Finite | tuple[Finite, ...] | tuple[tuple[Finite, ...], ...]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Robot(_Table):
    source: str = "arm3dof"
    servos: str = ""
    overrides: dict[str, Finite] = {}


class _Mpc(_Table):
    """Names and types of ``MpcSettings``, whose own checks follow."""

    formulation: Formulation | None = None
    horizon: int | None = None
    dt: Finite | None = None
    state_weight: Weight | None = None
    input_weight: Weight | None = None
    terminal_weight: Weight | None = None
    discretisation: Discretisation | None = None
    blocks: tuple[int, ...] | None = None
    torque_rate: Weight | None = None
    observer_gain: Finite | None = None
    measurement_noise: Finite | None = None
    delay: Finite | None = None
    limit_weight: Finite | None = None
    max_iterations: int | None = None
    tolerance: Finite | None = None
    max_step_time: Finite | None = None
    plan_validity: Finite | None = None


class _Gains(_Table):
    position: tuple[Finite, ...]
    velocity: tuple[Finite, ...]
    integral: tuple[Finite, ...]


class _Control(_Table):
    controller: cmd.ControllerName = "mpc"
    motor_delay_s: Finite = 0.0
    mpc: _Mpc = _Mpc()
    gains: _Gains | None = None


class _File(_Table):
    robot: _Robot = _Robot()
    control: _Control = _Control()


def load_tuned(path: Path) -> Tuned:
    """Read a STUDIO.toml.

    Args:
        path: the file.

    Raises:
        MissingFile: it cannot be read.
        InputError: it is not TOML, or a key is unknown or out of range.
    """
    try:
        file = _File.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        cure = "give a file that the studio wrote"
        raise unreadable(f"the settings {path}", error, cure) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not TOML: {error}; correct it there") from None
    except ValidationError as error:
        raise InputError(f"{path}: {explain(error, _File)}") from None
    robot, control = file.robot, file.control
    gains = None
    if (given := control.gains) is not None:
        if not len(given.position) == len(given.velocity) == len(given.integral):
            raise InputError(f"{path}: control.gains has lists of different lengths")
        gains = Gains(*(np.array(row) for row in (given.position, given.velocity, given.integral)))
    mpc = control.mpc.model_dump(exclude_unset=True)
    try:
        chosen = cmd.Control(control.controller, mpc, control.motor_delay_s, gains)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Tuned(robot.source, robot.overrides, robot.servos, chosen)


def save_tuned(path: Path, tuned: Tuned) -> Path:
    """Write a STUDIO.toml and return its path.

    Args:
        path: the file.
        tuned: what to keep.

    Raises:
        InputError: the file cannot be written.
    """
    write_atomically(path, render_tuned(tuned).encode())
    return path


def render_tuned(tuned: Tuned) -> str:
    """Return what was tuned as TOML."""
    control = tuned.control
    lines = ["[robot]", f"source = {_toml(tuned.source)}"]
    if tuned.servo:
        lines.append(f"servos = {_toml(tuned.servo)}")
    lines += ["", "[robot.overrides]", *_rows(tuned.overrides)]
    lines += ["", "[control]", f"controller = {_toml(control.controller)}"]
    lines += [f"motor_delay_s = {_toml(control.delay)}"]
    set_here = {key: value for key, value in control.mpc.items() if value is not None}
    lines += ["", "[control.mpc]", "# what is not here is as it comes", *_rows(set_here)]
    if (gains := control.gains) is not None:
        names = ("position", "velocity", "integral")
        lines += ["", "[control.gains]", *_rows({it: getattr(gains, it) for it in names})]
    return "\n".join(lines) + "\n"


def _rows(values: Mapping[str, object]) -> Iterable[str]:
    for key, value in values.items():
        name = key if key.replace("_", "").isalnum() and key.isascii() else _toml(key)
        yield f"{name} = {_toml(value)}"


def _toml(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            return f'"{escaped}"'
        case np.ndarray():
            return _toml(value.tolist())
        case list() | tuple():
            return "[" + ", ".join(map(_toml, value)) + "]"
        case int():
            return str(value)
        case float():
            return repr(float(value))
    raise TypeError(f"{value!r} has no place in a settings file")

"""Options that several commands share, and the reading of numbers from them."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Annotated

import typer

from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.model.servos import Servos

JsonFlag = Annotated[
    bool, typer.Option("--json", help="Print one JSON object and nothing else.", show_default=False)
]
RobotName = Annotated[
    str,
    typer.Option(
        "--robot", metavar="R", help="A name that `arm3dof robots` lists, or a URDF file."
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a number of the URDF, such as link2.mass=0.2 (kg, m, rad, N m). Repeatable.",
        show_default=False,
    ),
]
ServoNames = Annotated[
    list[str] | None,
    typer.Option(
        "--servos",
        metavar="[JOINT=]NAME",
        help="Servo of every joint, or of one joint (repeatable), such as DS3218: its torque, "
        "speed and travel become limits.",
        show_default=False,
    ),
]
OutFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder to write into.", show_default=False),
]


def writable(folder: Path) -> Path:
    """Make a folder that results will be written to, before the work that yields them.

    Raises:
        InputError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror}; name a folder to write to") from None
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {folder} is not writable; name a folder that you may write to")
    return folder


def robot_from(source: str, changes: list[str] | None, servos: list[str] | None = None) -> Robot:
    """Load a robot with the changes of ``--set`` and the limits of ``--servos``.

    Raises:
        InputError: a change is not ``KEY=VALUE`` with a number, or names nothing of this robot,
            or a servo is unknown.
        ArmError: the robot cannot be loaded.
    """
    overrides = read_overrides(changes) or None
    return load_robot(source, overrides=overrides, servos=read_servos(servos))


def read_overrides(changes: list[str] | None) -> dict[str, float]:
    """Read the changes of ``--set``.

    Raises:
        InputError: a change is not ``KEY=VALUE`` with a number.
    """
    overrides: dict[str, float] = {}
    for change in changes or ():
        key, equals, value = change.partition("=")
        if not equals or not key.strip():
            raise InputError(f"--set '{change}': write KEY=VALUE, for example link2.mass=0.2")
        overrides[key.strip()] = number(value, f"--set {key.strip()}")
    return overrides


def read_servos(words: list[str] | None) -> Servos | None:
    """Return what ``--servos`` says: one servo for all joints, or servos by joint.

    Raises:
        InputError: both are given, or two servos for all joints.
    """
    if not words:
        return None
    if len(words) == 1 and "=" not in words[0]:
        return words[0].strip()
    by_joint: dict[str, str] = {}
    for word in words:
        joint, equals, name = (part.strip() for part in word.partition("="))
        if not (equals and joint and name):
            raise InputError(
                f"--servos '{word}': write one NAME for all joints, or JOINT=NAME for each"
            )
        by_joint[joint] = name
    return by_joint


def number(text: str, what: str) -> float:
    """Read one finite number.

    Raises:
        InputError: the text is no number, or not a finite one.
    """
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{what} is '{text}'; give a number") from None
    if not math.isfinite(value):
        raise InputError(f"{what} is {text}; give a finite number")
    return value


def numbers(text: str, count: int, what: str) -> list[float]:
    """Read ``count`` finite numbers separated by commas.

    Raises:
        InputError: there are more or fewer, or one of them is not a finite number.
    """
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != count:
        raise InputError(f"{what} is '{text}'; give {count} numbers separated by commas")
    return [number(part, what) for part in parts]

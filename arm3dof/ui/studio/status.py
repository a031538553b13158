"""What the arm is doing, in one plain sentence."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.runtime.live.frames import Frames, Mode
from arm3dof.runtime.live.work import PHASES
from arm3dof.runtime.metrics import SETTLED_ERROR, SETTLED_SPEED

_AT_LIMIT = 0.999  # share of the torque limit that counts as all of it


class Tone(StrEnum):
    """How a sentence is to be taken; each has a colour on the page."""

    CALM = "calm"
    BUSY = "busy"
    GOOD = "good"
    WARN = "warn"


class Status(NamedTuple):
    """A sentence and its tone."""

    text: str
    tone: Tone


def describe(frame: Frames, robot: Robot, blind: str = "") -> Status:
    """Say what the arm is doing.

    Args:
        frame: the frame, shape ().
        robot: the arm that it is of.
        blind: why there are no pictures; empty while there are.
    """
    status = _doing(frame, robot)
    return Status(f"{status.text}. No picture: {blind}", Tone.WARN) if blind else status


def _doing(frame: Frames, robot: Robot) -> Status:
    if frame["paused"]:
        return Status("Paused: time stands still", Tone.CALM)
    mode = Mode(int(frame["mode"]))
    if mode is Mode.HOLDING:
        return Status("Holding still", Tone.CALM)
    if mode is Mode.BRAKING:
        return Status("Stopping: braking to rest", Tone.WARN)
    if mode is Mode.WORKING:
        phase = PHASES[int(frame["phase"])].sentence
        return Status(f"By itself: {phase}", Tone.BUSY)
    status, source = ControlStatus(int(frame["status"])), TorqueSource(int(frame["source"]))
    if source is not TorqueSource.OPTIMUM:
        return Status(f"Fallback, {source.sentence}: {status.sentence}", Tone.WARN)
    if status is not ControlStatus.SOLVED:
        return Status(f"Moving: {status.sentence}", Tone.WARN)
    limited = np.abs(frame["tau"]) >= _AT_LIMIT * robot.limits.tau_max
    if limited.any():
        names = ", ".join(np.array(robot.joint_names)[limited])
        return Status(f"Moving: {names} at the torque limit", Tone.BUSY)
    if has_arrived(frame):
        return Status("Arrived: on target, at rest", Tone.GOOD)
    return Status("Moving: solved, inside every limit", Tone.BUSY)


def has_arrived(frame: Frames) -> bool:
    """Return whether every joint is at its target and at rest."""
    off = np.abs(frame["q_target"] - frame["q"]).max()
    return bool(off < SETTLED_ERROR and np.abs(frame["v"]).max() < SETTLED_SPEED)

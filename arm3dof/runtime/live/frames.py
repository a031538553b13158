"""What the arm shows of itself: one row a frame, in memory that two processes share.

One process writes and never waits; any number read. A reader that is too slow misses rows, and a
row that is overwritten while it is read is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from multiprocessing.sharedctypes import RawArray
from typing import Any

import numpy as np
from numpy.typing import NDArray

PLAN_ROWS = 41
"""Stages of the plan that a frame holds at most; a longer horizon is thinned out."""
CAPACITY = 1 << 11
"""Frames that are kept: half a minute at 60 frames a second."""

Frames = NDArray[np.void]


class Mode(IntEnum):
    """What the arm is doing."""

    HOLDING = 0
    RUNNING = 1
    BRAKING = 2
    WORKING = 3


def frame_type(nv: int, bodies: int = 0) -> np.dtype[np.void]:
    """Return the type of a frame.

    ========================  ==============================================================
    ``t``                     time of the world [s]
    ``q v tau u q_target``    as in ``Recording``, shape (nv,)
    ``gravity``               torque that would hold the arm still, shape (nv,) [N m]
    ``tool``                  point between the fingers in the base frame, shape (3,) [m]
    ``plan_t plan_q plan_v``  predicted times, positions, velocities: ``plan_rows`` of them
    ``energy``                integral of |tau . v| since the run began [J]
    ``load``                  payload at the tool [kg]
    ``disturbance``           torque that the controller blames on others, shape (nv,) [N m]
    ``opening``               of the fingers [m]; NaN for an arm without
    ``bodies``                (x, y, z, qw, qx, qy, qz) of each object, shape (bodies, 7)
    ``fingers``               positions of the two fingers, shape (2,) [m]; NaN without
    ``mode status source``    ``Mode``, ``ControlStatus``, ``TorqueSource``
    ``phase``                 of a task: its place in ``Phase``
    ``step_time``             wall time of the last control step [s]
    ``lateness``              how late this frame's wake-up was [s]
    ``missed``                deadlines that were missed since the start
    ``paused run version``    whether time stands still; number of the run, of the robot
    ``control``               whether the controller ran in this frame
    ========================  ==============================================================

    Args:
        nv: number of joints.
        bodies: number of objects on the table.
    """
    joint = (nv,)
    return np.dtype(
        [
            ("t", "f8"),
            *((name, "f8", joint) for name in ("q", "v", "tau", "u", "q_target")),
            ("gravity", "f8", joint),
            ("disturbance", "f8", joint),
            ("tool", "f8", (3,)),
            ("plan_t", "f8", (PLAN_ROWS,)),
            *((name, "f8", (PLAN_ROWS, nv)) for name in ("plan_q", "plan_v")),
            *((name, "f8") for name in ("energy", "load", "opening", "step_time", "lateness")),
            ("bodies", "f8", (bodies, 7)),
            ("fingers", "f8", (2,)),
            *((name, "i8") for name in ("plan_rows", "missed", "run", "version")),
            *((name, "i8") for name in ("mode", "status", "source", "paused", "control", "phase")),
        ]
    )


class Ring:
    """The last frames, in memory that may be handed to a process when it is started."""

    def __init__(
        self, kind: np.dtype[np.void], make: Callable[..., Any] = RawArray, size: int = CAPACITY
    ) -> None:
        """Create an empty ring.

        Args:
            kind: type of its frames.
            make: makes the memory, ``RawArray`` of a multiprocessing context.
            size: how many frames it keeps.
        """
        self.kind, self.size = kind, size
        self._memory = make("b", 8 + size * kind.itemsize)
        self._attach()

    def __getstate__(self) -> dict[str, object]:
        return {"kind": self.kind, "size": self.size, "_memory": self._memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._attach()

    def _attach(self) -> None:
        self._count = np.frombuffer(self._memory, np.int64, 1)
        self._frames = np.frombuffer(self._memory, self.kind, self.size, 8)

    @property
    def count(self) -> int:
        """How many frames were ever written."""
        return int(self._count[0])

    def write(self, frame: Frames) -> None:
        """Add a frame, shape ()."""
        count = self.count
        self._frames[count % self.size] = frame
        self._count[0] = count + 1

    def since(self, count: int) -> tuple[int, Frames]:
        """Return the frames after the first ``count``, and the number to ask with next.

        What was overwritten meanwhile is missing at the front.
        """
        last = self.count
        first = max(count, last - self.size + 1, 0)
        rows = np.arange(first, last) % self.size
        frames = self._frames[rows]
        lost = self.count - self.size + 1 - first  # written over while they were copied
        return last, frames[max(lost, 0) :]

    def latest(self) -> Frames | None:
        """Return the last frame, shape (), or ``None`` before the first."""
        while True:
            count = self.count
            if count == 0:
                return None
            frame: Frames = self._frames[(count - 1) % self.size].copy()
            if self.count - count < self.size - 1:
                return frame

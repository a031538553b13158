"""What a controller returns, and the protocol that every controller follows."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np

from arm3dof.control.plan import Plan
from arm3dof.control.reference import Target
from arm3dof.state import Array, JointState


class ControlStatus(IntEnum):
    """What happened in a control step; ``sentence`` says it in words."""

    SOLVED = 0
    SOFTENED = 1
    NOT_SOLVED = 2
    DEADLINE_MISSED = 3
    BAD_MEASUREMENT = 4
    BAD_TARGET = 5

    @property
    def sentence(self) -> str:
        """The status in plain words."""
        return _STATUS_SENTENCES[self]


_STATUS_SENTENCES = {
    ControlStatus.SOLVED: "optimal, inside every limit",
    ControlStatus.SOFTENED: (
        "optimal, but a velocity or joint limit is exceeded, by as little as the torque allows"
    ),
    ControlStatus.NOT_SOLVED: "the solver reached no optimum",
    ControlStatus.DEADLINE_MISSED: "the optimum came later than max_step_time",
    ControlStatus.BAD_MEASUREMENT: "the measured state is not finite, or one that no arm can be in",
    ControlStatus.BAD_TARGET: "the target holds NaN or infinity",
}


class TorqueSource(IntEnum):
    """Where the torque of a control step comes from; ``sentence`` says it in words."""

    OPTIMUM = 0
    PREVIOUS_PLAN = 1
    BRAKING = 2

    @property
    def sentence(self) -> str:
        """The source in plain words."""
        return _SOURCE_SENTENCES[self]


_SOURCE_SENTENCES = {
    TorqueSource.OPTIMUM: "the optimum of this step",
    TorqueSource.PREVIOUS_PLAN: "the plan of the last good step, shifted to now",
    TorqueSource.BRAKING: "braking to rest against gravity",
}


@dataclass(frozen=True, eq=False)
class ControlStep:
    """One answer of a controller.

    ``tau`` is finite and inside the torque limits whatever happened.

    Attributes:
        tau: torque to apply until the next step, shape (nv,) [N m].
        u: the controller's input of (22), a joint acceleration, shape (nv,) [rad/s^2].
        plan: predicted states [e; v] at stages 0..N, shape (N + 1, 2 nv) [rad, rad/s]; one row
            for a controller that does not plan.
        status: what happened.
        source: where ``tau`` comes from.
        solve_time: wall time of the whole step [s].
    """

    tau: Array
    u: Array
    plan: Array
    status: ControlStatus
    source: TorqueSource
    solve_time: float


class PlannedStep(ControlStep):
    """An answer that puts its ``plan`` together when it is first read."""

    @classmethod
    def adopt(
        cls,
        tau: Array,
        u: Array,
        target: Array,
        plan: Plan,
        status: ControlStatus,
        source: TorqueSource,
        solve_time: float,
    ) -> PlannedStep:
        """Return an answer that takes over its arrays, unchecked, and freezes tau and u.

        Args:
            tau: see ``ControlStep``.
            u: see ``ControlStep``.
            target: shape (1, nv) or (N + 1, nv) [rad]; nobody changes it.
            plan: what the arm is expected to do; nobody changes it.
            status: see ``ControlStep``.
            source: see ``ControlStep``.
            solve_time: see ``ControlStep``.
        """
        step = object.__new__(cls)
        tau.setflags(write=False)
        u.setflags(write=False)
        own = step.__dict__
        own["tau"], own["u"], own["_motion"] = tau, u, (target, plan)
        own["status"], own["source"], own["solve_time"] = status, source, solve_time
        return step

    @cached_property
    def plan(self) -> Array:
        """Predicted states [e; v]; see ``ControlStep``."""
        target, motion = self.__dict__["_motion"]
        q = motion.q
        plan = np.hstack([target[: len(q)] - q, motion.v])
        plan.setflags(write=False)
        return plan


class Controller(Protocol):
    """Turns a measured state and a target into a torque, once every ``dt`` seconds."""

    @property
    def dt(self) -> float:
        """Time between two steps [s]."""

    def step(self, state: JointState, target: Target) -> ControlStep:
        """Return the torque to apply until the next step."""

    def reset(self) -> None:
        """Forget the past: the next step is as if it were the first."""


@runtime_checkable
class ReadsBetweenSteps(Protocol):
    """A controller that makes use of what encoders tell between two of its steps."""

    def observe(self, state: JointState) -> None:
        """Take note of a measurement between two steps."""

"""The answer of inverse kinematics: every solution found, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from arm3dof.state import Array, frozen_array

POSITION_TOLERANCE = 1e-10
"""Two points this near to each other are one point [m].

It decides everything that is decided by a tolerance: a target this near the border of the
workspace lies on it, and a joint may be moved onto its limit if the tool moves by no more.
"""


class Reason(StrEnum):
    """Why no solution inside the limits was found; ``sentence`` says it in words."""

    TOO_FAR = "too_far"
    TOO_NEAR = "too_near"
    OUTSIDE_LIMITS = "outside_limits"

    @property
    def sentence(self) -> str:
        """The reason in plain words."""
        return _REASON_SENTENCES[self]


_REASON_SENTENCES = {
    Reason.TOO_FAR: "the target is farther away than the arm reaches",
    Reason.TOO_NEAR: "the target lies in the hollow that the folded arm cannot enter",
    Reason.OUTSIDE_LIMITS: "the arm would reach the target only outside its joint limits",
}


class Singularity(StrEnum):
    """How a target is special to the paper's arm; ``sentence`` says it in words."""

    BASE_FREE = "base_free"
    SHOULDER_FREE = "shoulder_free"
    STRETCHED = "stretched"
    FOLDED = "folded"

    @property
    def sentence(self) -> str:
        """The singularity in plain words."""
        return _SINGULARITY_SENTENCES[self]


_SINGULARITY_SENTENCES = {
    Singularity.BASE_FREE: "the target lies on the first joint's axis: that joint is free",
    Singularity.SHOULDER_FREE: "the target is the shoulder itself: the second joint is free",
    Singularity.STRETCHED: "the elbow is straight: both elbow solutions are one",
    Singularity.FOLDED: "the elbow is folded: both elbow solutions are one",
}


@dataclass(frozen=True, eq=False)
class Reach:
    """What inverse kinematics says about one target.

    Solutions are ranked: those inside the limits first, then the nearest to the configuration that
    was asked for; without one, in the order of ``planar_ik.BRANCHES`` or, found numerically, by
    nearness to the middle of the limits. Each joint stands at the turn that lies inside its
    limits, and of several such turns at the nearest to that configuration (or to zero).

    Branch names: ``front`` has the first joint turned towards the target, ``back`` away from it,
    with the arm reaching over itself; ``elbow-up`` has the elbow above the line from shoulder to
    tool, ``elbow-down`` below it; ``elbow-straight`` and ``elbow-folded`` stand for both where
    they meet. ``numeric-1`` and so on are distinct postures found by a search; a redundant arm
    has more of them.

    Attributes:
        target: the point that was asked for, in the base frame, shape (3,) [m].
        solutions: joint positions that bring the tool there, shape (k, nq) [rad].
        branches: the name of each solution.
        within_limits: whether each solution is inside the joint limits, shape (k,).
        reason: why no solution is inside the limits; ``None`` when one is.
        nearest: nearest point that the arm reaches inside its limits, shape (3,) [m].
        nearest_q: joint positions inside the limits that reach ``nearest``, shape (nq,) [rad].
        joint: the joint at fault when the reason is ``OUTSIDE_LIMITS``: the one furthest outside,
            in the solution that is least outside.
        singularities: what is special about the target (closed form only).
        free_joints: joints that may take any angle; solutions hold them at the angle nearest to
            the configuration that was asked for (or to zero).
    """

    target: Array
    solutions: Array
    branches: tuple[str, ...]
    within_limits: NDArray[np.bool_]
    reason: Reason | None
    nearest: Array
    nearest_q: Array
    joint: str | None = None
    singularities: tuple[Singularity, ...] = ()
    free_joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("target", "nearest"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), 3, name=name))
        nearest_q = frozen_array(self.nearest_q, None, name="nearest_q")
        object.__setattr__(self, "nearest_q", nearest_q)
        rows = len(self.branches)
        solutions = frozen_array(self.solutions, rows, nearest_q.size, name="solutions")
        object.__setattr__(self, "solutions", solutions)
        within = np.array(self.within_limits, dtype=np.bool_).reshape(rows)
        within.flags.writeable = False
        object.__setattr__(self, "within_limits", within)

    @property
    def reachable(self) -> bool:
        """Whether some solution is inside the limits."""
        return self.reason is None

    @property
    def best(self) -> Array | None:
        """The preferred solution, shape (nq,) [rad]; ``None`` when none is inside the limits."""
        return self.solutions[0] if self.reachable else None

    @property
    def distance(self) -> float:
        """Distance from the target to ``nearest`` [m]; 0 when the target can be reached."""
        return 0.0 if self.reachable else math.dist(self.target, self.nearest)

    @property
    def sentence(self) -> str:
        """The whole answer in plain words."""
        if self.reason is None:
            count = int(self.within_limits.sum())
            return f"the target is reached in {count} way{'s' if count > 1 else ''}"
        fault = f" (joint '{self.joint}')" if self.joint else ""
        point = ", ".join(f"{x:.4f}" for x in self.nearest)
        return (
            f"{self.reason.sentence}{fault}; the nearest point that it reaches is [{point}] m, "
            f"{self.distance:.4g} m away"
        )


def joint_at_fault(outside: Array) -> int:
    """Return the joint furthest outside, in the solution that is least outside its limits.

    Args:
        outside: how far each joint of each solution is outside, shape (k, nv) [rad].
    """
    return int(np.argmax(outside[np.argmin(outside.max(axis=1))]))

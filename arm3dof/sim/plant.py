"""The protocol of everything that stands in for the arm: a torque in, the next state out."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from arm3dof.model.robot import Robot
from arm3dof.state import JointState


class Plant(Protocol):
    """An arm that can be placed in a state and moved by torques."""

    @property
    def robot(self) -> Robot:
        """The robot that the plant moves."""

    @property
    def dt(self) -> float:
        """Time of one step [s]."""

    @property
    def state(self) -> JointState:
        """The present state."""

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state and return it."""

    def step(self, tau: ArrayLike) -> JointState:
        """Hold a torque, shape (nv,) [N m], for ``dt`` and return the state after it."""

"""The protocol of everything that stands in for the arm: a torque in, the next state out."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


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
        """The present state, as it truly is."""

    @property
    def applied_torque(self) -> Array:
        """What the motors gave in the last step, shape (nv,) [N m]; zero before the first."""

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state and return it."""

    def step(self, tau: ArrayLike) -> JointState:
        """Hold a torque, shape (nv,) [N m], for ``dt`` and return the state after it."""

    def measure(self) -> JointState:
        """Return the present state as the sensors tell it; asked twice, the same."""


class DisturbablePlant(Plant, Protocol):
    """A plant to which things can be done that no motor does; ``DisturbedPlant`` wraps one."""

    def step(
        self,
        tau: ArrayLike,
        *,
        external_torque: ArrayLike | None = None,
        tool_wrench: ArrayLike | None = None,
    ) -> JointState:
        """Hold a torque for ``dt`` while the surroundings push, and return the state after it.

        Args:
            tau: torque of the motors, shape (nv,) [N m].
            external_torque: torque that the surroundings add at the joints, shape (nv,) [N m].
            tool_wrench: force [N] and torque [N m] on the tool in base axes, shape (6,).
        """

    def displace(self, change: ArrayLike) -> JointState:
        """Move the joints at once by ``change``, shape (nv,) [rad], and return the state."""

    def change_robot(self, robot: Robot) -> None:
        """Go on with another robot of as many joints, such as one that took up a payload."""


def check_start(robot: Robot, state: JointState) -> None:
    """Check that an arm can be placed in a state.

    Raises:
        InputError: the state is not finite or belongs to another robot.
    """
    if state.q.size != robot.nv or not state.is_finite:
        raise InputError(
            f"the state is q = {state.q}, v = {state.v}; "
            f"{robot.name} needs {robot.nv} finite positions and velocities"
        )


Inner = TypeVar("Inner", bound=DisturbablePlant)


class PlantAround(Generic[Inner]):
    """A plant around another one, of which it passes on what has not changed.

    Attributes:
        plant: the plant inside.
    """

    def __init__(self, plant: Inner) -> None:
        """Surround a plant."""
        self.plant = plant

    @property
    def robot(self) -> Robot:
        """The robot that moves now, payload included; the controller's may be another."""
        return self.plant.robot

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self.plant.dt

    @property
    def state(self) -> JointState:
        """The present state, as it truly is."""
        return self.plant.state

    @property
    def applied_torque(self) -> Array:
        """What the motors gave in the last step, shape (nv,) [N m]; zero before the first."""
        return self.plant.applied_torque

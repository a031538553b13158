"""What every formulation of the horizon shares: its weights, stages and shape."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.prediction import (
    StateSpace,
    discretise_euler,
    discretise_exact,
    double_integrator,
    riccati,
    weight_matrix,
)
from arm3dof.control.program import Program
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState, frozen_array

_REGULARISATION = 1e-10  # share of the Hessian's largest entry that is added to its diagonal


class Weights:
    """The weights of (37) as matrices.

    Attributes:
        Q: weight of the state at stages 0..N-1, shape (2 nv, 2 nv).
        R: weight of the input, shape (nv, nv).
        P: weight of the state at stage N, shape (2 nv, 2 nv).
    """

    def __init__(self, settings: MpcSettings, nv: int) -> None:
        self.Q = weight_matrix(settings.state_weight, 2, nv, "state_weight")
        self.R = weight_matrix(settings.input_weight, 1, nv, "input_weight")
        if settings.terminal_weight is None:
            at_rest = discretise(double_integrator(nv), settings)
            self.P = riccati(at_rest, self.Q, self.R)
        else:
            self.P = weight_matrix(settings.terminal_weight, 2, nv, "terminal_weight")


class Formulation(Protocol):
    """Turns a state and what is to be followed into the program of one control step.

    Attributes:
        linearisations: how often a step without a previous plan is linearised anew.
        weights: the weights of the cost.
    """

    linearisations: int
    weights: Weights

    def reset(self) -> None:
        """Take over the robot's masses as they are now."""

    def build(
        self, state: JointState, reference: Reference, plan: Array | None, disturbance: Array
    ) -> Program:
        """Return the program of one step.

        Args:
            state: state at stage 0.
            reference: what to follow at stages 0..N; one row for a constant target.
            plan: accelerations of the last plan, shifted to now, shape (N, nv) [rad/s^2]; ``None``
                if there is none.
            disturbance: estimated torque that acts beside ours, shape (nv,) [N m].
        """


def discretise(system: StateSpace, settings: MpcSettings) -> StateSpace:
    """Return the discrete system by the method that the settings name."""
    method = discretise_euler if settings.discretisation == "euler" else discretise_exact
    return method(system, settings.dt)


def block_of_stage(settings: MpcSettings) -> NDArray[np.intp]:
    """Return the block of decisions that each stage uses, shape (N,)."""
    if settings.blocks is None:
        return np.arange(settings.horizon)
    return np.repeat(np.arange(len(settings.blocks)), settings.blocks)


def blocked(columns: Array, blocks: NDArray[np.intp], nv: int) -> Array:
    """Add up the columns of stages that share their decisions.

    Args:
        columns: derivative by the inputs of all stages, shape (..., N nv).
        blocks: block of each stage, shape (N,).
        nv: number of joints.
    """
    if blocks[-1] == blocks.size - 1:
        return columns
    stages = columns.reshape(*columns.shape[:-1], blocks.size, nv)
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    return np.add.reduceat(stages, starts, axis=-2).reshape(*columns.shape[:-1], -1)


def invert_hessian(hessian: Array, worst_condition: float = 1e9) -> tuple[Array, Array]:
    """Return a Hessian and its inverse, made positive definite where weights of zero left it not.

    Raises:
        numpy.linalg.LinAlgError: the Hessian is not finite, or too ill-conditioned to be of use:
            the prediction explodes.
    """
    size = hessian.shape[0]
    largest = float(hessian.diagonal().max(initial=0.0))
    regular = hessian + np.eye(size) * max(_REGULARISATION * largest, 1e-12)
    inverse = np.linalg.inv(regular)
    if not largest * float(np.abs(inverse).max()) < worst_condition:
        raise np.linalg.LinAlgError("ill-conditioned Hessian")
    return frozen_array(regular, size, size, name="H"), (inverse + inverse.T) / 2


def solve_hessian(hessian: Array, inverse: Array, right: Array) -> Array:
    """Return H^-1 right, with one step of refinement against a badly conditioned H."""
    first = inverse @ right
    return first + inverse @ (right - hessian @ first)


def damping_share(robot: Robot, dt: float) -> Array:
    """Return where in a sample damping is to be evaluated, 1/2 (middle) to 1 (end), shape (nv,).

    With u held over a sample, damping D on an inertia m takes on average D (v + share dt u), with
    share = 1 / (1 - exp(-r)) - 1 / r and r = D dt / m: the middle for light damping, the end for
    damping that settles within the sample. m is taken in the middle of the joint range.
    """
    rate = np.maximum(robot.damping * dt / middle_inertia(robot), 1e-3)
    return 1.0 / -np.expm1(-rate) - 1.0 / rate


def middle_inertia(robot: Robot) -> Array:
    """Return the inertia that each joint turns in the middle of its range, shape (nv,) [kg m^2]."""
    middle = robot.limits.q_min / 2 + robot.limits.q_max / 2
    return robot.mass_matrix(np.where(np.isfinite(middle), middle, 0.0)).diagonal()

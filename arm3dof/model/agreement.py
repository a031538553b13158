"""How far the paper's closed form and Pinocchio agree on one robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.model.dynamics import ClosedForm
from arm3dof.model.robot import Robot
from arm3dof.state import Array


class Agreement(NamedTuple):
    """Largest absolute differences between the closed form and Pinocchio over random states.

    Attributes:
        M: of the mass matrix [kg m^2].
        C: of the Coriolis torque C v [N m].
        g: of the gravity torque [N m].
    """

    M: float
    C: float
    g: float


def closed_form_agreement(
    robot: Robot, rng: np.random.Generator, *, samples: int = 1000
) -> Agreement:
    """Compare M, C v and g of (19) with Pinocchio's at random states inside the limits.

    Args:
        robot: a robot whose kinematics fit the paper's chain.
        rng: source of the states.
        samples: number of states.

    Raises:
        DhMisfit: the robot does not fit.
    """
    form = ClosedForm.from_robot(robot)
    q = np.array([robot.random_configuration(rng) for _ in range(samples)])
    v = rng.uniform(-1, 1, q.shape) * robot.limits.v_max
    coriolis = np.array([robot.coriolis(*state) @ state[1] for state in zip(q, v, strict=True)])
    mass, gravity = (np.array([of(row) for row in q]) for of in (robot.mass_matrix, robot.gravity))
    return Agreement(
        M=_largest(form.mass_matrix(q) - mass),
        C=_largest(np.einsum("kij,kj->ki", form.coriolis(q, v), v) - coriolis),
        g=_largest(form.gravity(q) - gravity),
    )


def _largest(difference: Array) -> float:
    return float(np.abs(difference).max())

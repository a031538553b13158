"""The paper's formulation: error dynamics frozen at the measured state, (22)-(38)."""

from __future__ import annotations

import numpy as np

from arm3dof.control.formulation import (
    Weights,
    block_of_stage,
    blocked,
    damping_share,
    discretise,
    invert_hessian,
    solve_hessian,
)
from arm3dof.control.prediction import (
    Condensed,
    QuadraticCost,
    condense,
    error_dynamics,
    quadratic_cost,
)
from arm3dof.control.program import LinearProgram, Program
from arm3dof.control.reference import Reference
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


class PaperFormulation:
    """Builds the program of one control step from the dynamics at the measured state.

    The decision is u = M^-1 (tau - g), (22) with its sign corrected, so tau = M u + g. Joint
    friction, which the paper does not model, is compensated in tau. A moving target is taken as
    standing still at each sample, as (25)-(27) do.
    """

    linearisations = 1

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        self._robot, self._settings = robot, settings
        self.weights = Weights(settings, robot.nv)
        self._blocks = block_of_stage(settings)
        self._damping_inertia = np.diag(
            settings.dt * robot.damping * damping_share(robot, settings.dt)
        )

    def reset(self) -> None:
        """Do nothing: no step depends on the one before."""

    def predict(self, state: JointState) -> Condensed:
        """Return C and F of (36) with the dynamics frozen at a state."""
        mass, coriolis = self._robot.mass_matrix(state.q), self._robot.coriolis(state.q, state.v)
        system = discretise(error_dynamics(mass, coriolis), self._settings)
        return condense(system, self._settings.horizon)

    def cost(self, prediction: Condensed) -> QuadraticCost:
        """Return Y, M and H of (38)."""
        return quadratic_cost(prediction, self.weights.Q, self.weights.R, self.weights.P)

    def build(
        self, state: JointState, reference: Reference, plan: Array | None, disturbance: Array
    ) -> Program:
        """Return the program of one step; see ``Formulation.build``. The plan is not used."""
        robot, horizon, nv = self._robot, self._settings.horizon, self._robot.nv
        q_target = reference.q[0]
        x = np.concatenate([q_target - state.q, state.v])
        prediction = self.predict(state)
        cost = self.cost(prediction)
        # sum over the stages of a block, on both sides of H
        half = blocked(cost.H, self._blocks, nv)
        hessian, inverse = invert_hessian(blocked(half.T, self._blocks, nv))
        gradient = blocked(cost.M.T @ x, self._blocks, nv)
        response = blocked(prediction.F, self._blocks, nv).reshape(horizon + 1, 2, nv, -1)
        response = response[1:].swapaxes(0, 1) * np.array([-1.0, 1.0])[:, None, None, None]
        free = (prediction.C @ x).reshape(horizon + 1, 2, nv)[1:].swapaxes(0, 1)
        gain = robot.mass_matrix(state.q) + self._damping_inertia
        offset = robot.gravity(state.q) + robot.damping * state.v - disturbance
        return LinearProgram(
            hessian=hessian,
            hessian_inverse=inverse,
            w_free=-solve_hessian(hessian, inverse, gradient),
            block_of_stage=self._blocks,
            torque_gain=np.broadcast_to(gain, (horizon, nv, nv)),
            torque_offset=np.broadcast_to(offset, (horizon, nv)),
            free_response=np.stack([q_target - free[0], free[1]]),
            response=np.ascontiguousarray(response),
        )

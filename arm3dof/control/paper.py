"""The paper's formulation: error dynamics frozen at the measured state, (22)-(38)."""

from __future__ import annotations

import numpy as np

from arm3dof.control.prediction import (
    Condensed,
    QuadraticCost,
    condense,
    discretise_euler,
    discretise_exact,
    double_integrator,
    error_dynamics,
    quadratic_cost,
    riccati,
    weight_matrix,
)
from arm3dof.control.program import Program
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


class PaperFormulation:
    """Builds the QP of one control step from the dynamics at the measured state.

    The input is u = M^-1 (tau - g), (22) with its sign corrected, so tau = M u + g. Joint
    friction, which the paper does not model, is compensated in tau.
    """

    def __init__(self, robot: Robot, settings: MpcSettings) -> None:
        nv = robot.nv
        self._robot, self._settings = robot, settings
        self._discretise = (
            discretise_euler if settings.discretisation == "euler" else discretise_exact
        )
        self.Q = weight_matrix(settings.state_weight, 2, nv, "state_weight")
        self.R = weight_matrix(settings.input_weight, 1, nv, "input_weight")
        if settings.terminal_weight is None:
            at_rest = self._discretise(double_integrator(nv), settings.dt)
            self.P = riccati(at_rest, self.Q, self.R)
        else:
            self.P = weight_matrix(settings.terminal_weight, 2, nv, "terminal_weight")

    def predict(self, state: JointState) -> Condensed:
        """Return C and F of (36) with the dynamics frozen at a state."""
        mass, coriolis = self._robot.mass_matrix(state.q), self._robot.coriolis(state.q, state.v)
        system = self._discretise(error_dynamics(mass, coriolis), self._settings.dt)
        return condense(system, self._settings.horizon)

    def cost(self, prediction: Condensed) -> QuadraticCost:
        """Return Y, M and H of (38)."""
        return quadratic_cost(prediction, self.Q, self.R, self.P)

    def build(self, state: JointState, q_target: Array) -> Program:
        """Return the torque-limited QP of one step, and its prediction.

        Args:
            state: measured state.
            q_target: target, shape (nv,) [rad].
        """
        robot, dt, horizon = self._robot, self._settings.dt, self._settings.horizon
        x = np.concatenate([q_target - state.q, state.v])
        prediction = self.predict(state)
        cost = self.cost(prediction)
        # with damping D held against its value at the sample's end, tau = (M + T D) u + g + D v
        gain = robot.mass_matrix(state.q) + dt * np.diag(robot.damping)
        offset = robot.gravity(state.q) + robot.damping * state.v
        return Program(
            H=cost.H,
            g=cost.M.T @ x,
            torque_gain=np.broadcast_to(gain, (horizon, *gain.shape)),
            torque_offset=np.broadcast_to(offset, (horizon, robot.nv)),
            free_response=prediction.C @ x,
            response=prediction.F,
        )

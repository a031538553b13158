"""The problem as Crocoddyl's BoxFDDP takes it: torque is the decision, its box is the limit.

The nearest formulation that BoxFDDP offers. The same: the arm, the horizon, the cost of x and of
the joint acceleration (a residual, so its Hessian is Gauss and Newton's), the terminal weight, and
the torque limits. Different: forward dynamics are part of the prediction, which integrates by
semi-implicit instead of explicit Euler; joint damping is left out (its dynamics have none); and
velocity and joint limits are quadratic barriers, because only the input can have hard bounds.
"""

from __future__ import annotations

import time

import crocoddyl
import numpy as np
import pinocchio as pin

from benchmarks.peers.answer import Answer
from benchmarks.peers.pinocchio_arm import build_model
from benchmarks.peers.problem import Array, Problem


class BoxFddp:
    """BoxFDDP from the previous solution shifted by one stage, capped at some iterations.

    With ``limits`` off the barriers of the velocity and joint limits are left out: less than what
    the others solve, and faster.
    """

    def __init__(self, problem: Problem, *, max_iterations: int, limits: bool = True) -> None:
        self._problem, self._limits = problem, limits
        self._max_iterations = max_iterations
        self._model = build_model(problem)
        self._data = self._model.createData()
        self._state = crocoddyl.StateMultibody(self._model)
        self.reset(np.zeros(problem.arm.joints))

    def reset(self, q_target: Array) -> None:
        """Aim at a target; the next step has no previous solution."""
        at_target = np.concatenate([q_target, np.zeros(q_target.size)])
        stage = self._stage(at_target)
        shooting = crocoddyl.ShootingProblem(
            at_target, [stage] * self._problem.horizon, self._end(at_target)
        )
        shooting.nthreads = 1
        self._solver = crocoddyl.SolverBoxFDDP(shooting)
        self._left_out = float(at_target @ self._end_weight() @ at_target) / 2
        self._fresh = True

    def step(self, q: Array, v: Array) -> Answer:
        """Return the torque for a measured state."""
        solver = self._solver
        cap = self._max_iterations
        start = time.perf_counter()
        x0 = np.concatenate([q, v])
        solver.problem.x0 = x0
        if self._fresh:
            hold = pin.computeGeneralizedGravity(self._model, self._data, q).copy()
            xs = [x0] * (self._problem.horizon + 1)
            us = [hold] * self._problem.horizon
            cap, self._fresh = 100, False
        else:
            xs, us = solver.xs.tolist(), solver.us.tolist()
            xs = [x0, *xs[2:], xs[-1]]
            us = [*us[1:], us[-1]]
        called = time.perf_counter()
        converged = solver.solve(xs, us, cap, False)
        solved = time.perf_counter()
        tau = np.array(solver.us[0])
        end = time.perf_counter()
        return Answer(
            tau=tau,
            u=pin.aba(self._model, self._data, q, v, tau).copy(),
            cost=float(solver.cost) + self._left_out,
            step_time=end - start,
            solve_time=solved - called,
            iterations=min(int(solver.iter) + 1, cap),
            converged=bool(converged),
        )

    def _stage(self, at_target: Array) -> crocoddyl.IntegratedActionModelEuler:
        p, state = self._problem, self._state
        nu = p.arm.joints
        costs = crocoddyl.CostModelSum(state, nu)
        error = crocoddyl.ResidualModelState(state, at_target, nu)
        # Crocoddyl counts half of a weighed square, times dt
        weights = crocoddyl.ActivationModelWeightedQuad(_diagonal(p.Q, "Q"))
        costs.addCost("x", crocoddyl.CostModelResidual(state, weights, error), 2 / p.dt)
        acceleration = crocoddyl.ResidualModelJointAcceleration(state, nu)
        weights = crocoddyl.ActivationModelWeightedQuad(_diagonal(p.R, "R"))
        costs.addCost("u", crocoddyl.CostModelResidual(state, weights, acceleration), 2 / p.dt)
        if self._limits:
            low, high = np.concatenate([p.q_min, -p.v_max]), np.concatenate([p.q_max, p.v_max])
            barrier = crocoddyl.ActivationModelQuadraticBarrier(
                crocoddyl.ActivationBounds(low, high)
            )
            outside = crocoddyl.ResidualModelState(state, np.zeros(2 * nu), nu)
            residual = crocoddyl.CostModelResidual(state, barrier, outside)
            costs.addCost("limits", residual, p.limit_price / p.dt)
        actuation = crocoddyl.ActuationModelFull(state)
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        stage = crocoddyl.IntegratedActionModelEuler(dynamics, p.dt)
        stage.u_lb, stage.u_ub = -p.tau_max, p.tau_max
        return stage

    def _end(self, at_target: Array) -> crocoddyl.ActionModelLQR:
        """Return x_N' P x_N up to a constant: P couples e and v, as a state residual could not."""
        n = self._problem.arm.joints
        P, nothing = self._end_weight(), np.zeros((2 * n, n))
        drift, linear = np.zeros(2 * n), -P @ at_target
        return crocoddyl.ActionModelLQR(
            np.eye(2 * n), nothing, P, np.eye(n), nothing, drift, linear, np.zeros(n)
        )

    def _end_weight(self) -> Array:
        """Return twice P for [q; v] instead of [e; v]."""
        sign = np.repeat([-1.0, 1.0], self._problem.arm.joints)  # e = q_target - q
        return 2 * sign[:, np.newaxis] * self._problem.P * sign


def _diagonal(weight: Array, name: str) -> Array:
    """Return a weight's diagonal.

    Raises:
        ValueError: the weight couples components, which Crocoddyl's activations cannot.
    """
    if np.any(weight != np.diag(np.diag(weight))):
        raise ValueError(f"{name} couples components; give Crocoddyl a diagonal weight")
    return np.array(np.diag(weight))

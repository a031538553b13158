"""The nonlinear MPC in CasADi, solved by IPOPT: multiple shooting with exact derivatives."""

from __future__ import annotations

import time

import casadi as ca
import numpy as np

from benchmarks.peers.answer import Answer
from benchmarks.peers.casadi_dynamics import inverse_dynamics
from benchmarks.peers.problem import Array, Problem

_OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "bound_relax_factor": 0.0,
    "max_iter": 200,
    "linear_solver": "mumps",
    "mu_strategy": "adaptive",  # measured: half the time of the default from a good start
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-8,
    "warm_start_bound_frac": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
    "warm_start_slack_bound_frac": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
}


class Ipopt:
    """The problem to convergence, from the previous solution shifted by one stage.

    With ``soft_limits`` the velocity and joint limits have slacks priced as in the problem; they
    make it feasible from everywhere. Without, they bound the states, which is faster, and what a
    user of IPOPT would write.
    """

    def __init__(self, problem: Problem, *, soft_limits: bool, tolerance: float) -> None:
        self._problem = problem
        n, horizon = problem.arm.joints, problem.horizon
        self._n, self._horizon = n, horizon
        self._tau = _torque(problem)
        x = ca.SX.sym("x", 2 * n, horizon)  # stages 1..N
        u = ca.SX.sym("u", n, horizon)
        slack = ca.SX.sym("s", 2 * n, horizon if soft_limits else 0)
        x0, q_target = ca.SX.sym("x0", 2 * n), ca.SX.sym("q_target", n)
        before = ca.horzcat(x0, x[:, :-1])
        gaps = ca.DM(problem.A) @ before + ca.DM(problem.B) @ u - x
        torques = [self._tau(q_target, before[:, k], u[:, k]) for k in range(horizon)]
        cost = _cost(problem, before, u, x[:, -1], slack)
        z = ca.veccat(x, u, slack)
        g = [ca.vec(gaps), *torques]
        if soft_limits:
            limited = ca.vertcat(ca.repmat(q_target, 1, horizon) - x[:n, :], x[n:, :])
            g += [ca.vec(limited - slack), ca.vec(limited + slack)]
        options = dict(_OPTIONS, tol=tolerance)
        nlp = {"x": z, "p": ca.vertcat(x0, q_target), "f": cost, "g": ca.vertcat(*g)}
        self._solver = ca.nlpsol("mpc", "ipopt", nlp, {"print_time": False, "ipopt": options})
        self._set_bounds(soft_limits)
        self._target = np.zeros(n)
        self._previous: tuple[Array, Array, Array] | None = None

    def reset(self, q_target: Array) -> None:
        """Aim at a target; the next step has no previous solution."""
        self._target = q_target
        self._previous = None
        if not self._soft:
            p, n = self._problem, self._n
            self._lower[: self._states].reshape(-1, 2 * n)[:, :n] = q_target - p.q_max
            self._upper[: self._states].reshape(-1, 2 * n)[:, :n] = q_target - p.q_min

    def step(self, q: Array, v: Array) -> Answer:
        """Return the torque for a measured state."""
        start = time.perf_counter()
        x0 = np.concatenate([self._target - q, v])
        z, bound_price, row_price = self._previous or self._first_guess(x0)
        called = time.perf_counter()
        solution = self._solver(
            x0=z,
            lam_x0=bound_price,
            lam_g0=row_price,
            p=np.concatenate([x0, self._target]),
            lbx=self._lower,
            ubx=self._upper,
            lbg=self._rows_low,
            ubg=self._rows_high,
        )
        solved = time.perf_counter()
        z = solution["x"].full().ravel()
        u = z[self._states : self._states + self._n]
        tau = self._tau(self._target, x0, u).full().ravel()
        self._previous = self._shifted(
            z, solution["lam_x"].full().ravel(), solution["lam_g"].full().ravel()
        )
        end = time.perf_counter()
        stats = self._solver.stats()
        return Answer(
            tau=tau,
            u=u,
            cost=float(solution["f"]),
            step_time=end - start,
            solve_time=solved - called,
            iterations=int(stats["iter_count"]),
            converged=bool(stats["success"]),
        )

    def _first_guess(self, x0: Array) -> tuple[Array, Array, Array]:
        z = np.zeros(self._lower.size)
        z[: self._states] = np.tile(x0, self._horizon)
        return z, np.zeros(z.size), np.zeros(self._rows_low.size)

    def _shifted(self, *parts: Array) -> tuple[Array, ...]:
        """Move every stage's values one stage earlier; the last stage's stay as well."""
        return tuple(
            np.concatenate(
                [
                    np.concatenate([block[1:], block[-1:]]).ravel()
                    for block in self._stages(part, widths)
                ]
            )
            for part, widths in zip(parts, (self._widths, self._widths, self._rows), strict=True)
        )

    def _stages(self, values: Array, widths: tuple[int, ...]) -> list[Array]:
        ends = np.cumsum([width * self._horizon for width in widths])[:-1]
        blocks = np.split(values, ends)
        return [block.reshape(self._horizon, -1) for block in blocks]

    def _set_bounds(self, soft_limits: bool) -> None:
        p, n, horizon = self._problem, self._n, self._horizon
        self._soft = soft_limits
        self._states = 2 * n * horizon
        self._widths = (2 * n, n, 2 * n) if soft_limits else (2 * n, n)
        self._rows = (2 * n, n, 2 * n, 2 * n) if soft_limits else (2 * n, n)
        free, tau_max = np.full(2 * n, np.inf), np.tile(p.tau_max, horizon)
        self._rows_low = np.concatenate([np.zeros(self._states), -tau_max])
        self._rows_high = np.concatenate([np.zeros(self._states), tau_max])
        high_x = np.concatenate([np.full(n, np.inf), p.v_max])
        if soft_limits:
            low, high = np.concatenate([p.q_min, -p.v_max]), np.concatenate([p.q_max, p.v_max])
            self._rows_low = np.concatenate(
                [self._rows_low, np.tile(-free, horizon), np.tile(low, horizon)]
            )
            self._rows_high = np.concatenate(
                [self._rows_high, np.tile(high, horizon), np.tile(free, horizon)]
            )
            high_x = free
        states, inputs = np.tile(high_x, horizon), np.full(n * horizon, np.inf)
        slacks = self._states if soft_limits else 0
        self._lower = np.concatenate([-states, -inputs, np.zeros(slacks)])
        self._upper = np.concatenate([states, inputs, np.full(slacks, np.inf)])


def _torque(problem: Problem) -> ca.Function:
    """Return tau(q_target, x, u) in the middle of a sample, joint damping included."""
    n, half = problem.arm.joints, problem.dt / 2
    q_target, x, u = ca.SX.sym("q_target", n), ca.SX.sym("x", 2 * n), ca.SX.sym("u", n)
    v = x[n:]
    q_middle = q_target - x[:n] + half * v + half**2 / 2 * u
    rigid = inverse_dynamics(problem.arm)(q_middle, v + half * u, u)
    damped_at = ca.DM(problem.damping_share * problem.dt)
    tau = rigid + ca.DM(problem.damping) * (v + damped_at * u)
    return ca.Function("stage_torque", [q_target, x, u], [tau])


def _cost(problem: Problem, x: ca.SX, u: ca.SX, x_end: ca.SX, slack: ca.SX) -> ca.SX:
    """Return (37), and the price of leaving the limits."""
    Q, R, P = (ca.sparsify(ca.DM(weight)) for weight in (problem.Q, problem.R, problem.P))
    stages = ca.sum1(ca.sum2(x * (Q @ x))) + ca.sum1(ca.sum2(u * (R @ u)))
    end = ca.dot(x_end, P @ x_end)
    return stages + end + problem.limit_price * ca.sum1(ca.sum2(slack)) + ca.sumsqr(slack) / 2

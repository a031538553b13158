"""The prediction matrices against direct simulation and independent formulas."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_discrete_are

from arm3dof.control.prediction import (
    StateSpace,
    condense,
    discretise_euler,
    discretise_exact,
    double_integrator,
    error_dynamics,
    quadratic_cost,
    riccati,
    weight_matrix,
)
from arm3dof.errors import InputError


def random_dynamics(rng, nv):
    root = rng.normal(size=(nv, nv))
    return root @ root.T + nv * np.eye(nv), rng.normal(size=(nv, nv))


def random_weights(rng, n):
    root = rng.normal(size=(n, n))
    return root @ root.T


@pytest.mark.parametrize("nv", [1, 3, 7])
def test_error_dynamics_are_those_of_27(nv):
    rng = np.random.default_rng(nv)
    mass, coriolis = random_dynamics(rng, nv)
    A, B = error_dynamics(mass, coriolis)
    e, v, u = rng.normal(size=(3, nv))
    rate = A @ np.r_[e, v] + B @ u
    np.testing.assert_allclose(rate[:nv], -v)
    np.testing.assert_allclose(mass @ rate[nv:], mass @ u - coriolis @ v, atol=1e-12)


def test_euler_is_33_and_exact_is_the_held_input_integral():
    rng = np.random.default_rng(0)
    system = error_dynamics(*random_dynamics(rng, 3))
    dt = 0.05
    euler, exact = discretise_euler(system, dt), discretise_exact(system, dt)
    np.testing.assert_array_equal(euler.A, np.eye(6) + dt * system.A)
    np.testing.assert_array_equal(euler.B, dt * system.B)
    x, u = rng.normal(size=6), rng.normal(size=3)
    path = solve_ivp(lambda _, y: system.A @ y + system.B @ u, (0, dt), x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(exact.A @ x + exact.B @ u, path.y[:, -1], atol=1e-11)


def test_the_double_integrator_is_exact_in_closed_form():
    dt = 0.05
    A, B = discretise_exact(double_integrator(2), dt)
    identity, zero = np.eye(2), np.zeros((2, 2))
    np.testing.assert_allclose(A, np.block([[identity, -dt * identity], [zero, identity]]))
    np.testing.assert_allclose(B, np.vstack([-(dt**2) / 2 * identity, dt * identity]))


@pytest.mark.parametrize("horizon", [1, 2, 20])
def test_condensed_prediction_equals_stepping(horizon):
    rng = np.random.default_rng(horizon)
    system = StateSpace(rng.normal(size=(6, 6)) / 3, rng.normal(size=(6, 3)))
    C, F = condense(system, horizon)
    x0, inputs = rng.normal(size=6), rng.normal(size=(horizon, 3))
    states = [x0]
    for u in inputs:
        states.append(system.A @ states[-1] + system.B @ u)
    np.testing.assert_allclose(C @ x0 + F @ inputs.ravel(), np.concatenate(states), atol=1e-12)


@pytest.mark.parametrize("horizon", [1, 5])
def test_the_quadratic_form_of_38_equals_the_sum_of_37(horizon):
    rng = np.random.default_rng(horizon)
    system = StateSpace(rng.normal(size=(6, 6)) / 3, rng.normal(size=(6, 3)))
    Q, P, R = random_weights(rng, 6), random_weights(rng, 6), random_weights(rng, 3)
    prediction = condense(system, horizon)
    Y, M, H = quadratic_cost(prediction, Q, R, P)
    np.testing.assert_array_equal(H, H.T)
    for _ in range(10):
        x, U = rng.normal(size=6), rng.normal(size=3 * horizon)
        X = (prediction.C @ x + prediction.F @ U).reshape(-1, 6)
        J = X[-1] @ P @ X[-1]
        J += sum(a @ Q @ a + b @ R @ b for a, b in zip(X, U.reshape(-1, 3), strict=False))
        assert x @ Y @ x / 2 + x @ M @ U + U @ H @ U / 2 == pytest.approx(J, rel=1e-12)


def test_the_riccati_weight_makes_every_horizon_choose_the_same_input():
    rng = np.random.default_rng(1)
    system = discretise_euler(double_integrator(3), 0.05)
    Q, R = np.diag(rng.uniform(0.1, 2, 6)), np.diag(rng.uniform(0.001, 0.01, 3))
    P = riccati(system, Q, R)
    x = rng.normal(size=6)
    first = [
        -np.linalg.solve(cost.H, cost.M.T @ x)[:3]
        for cost in (quadratic_cost(condense(system, n), Q, R, P) for n in (1, 4, 30))
    ]
    np.testing.assert_allclose(first[0], first[1], rtol=1e-8)
    np.testing.assert_allclose(first[0], first[2], rtol=1e-8)


@pytest.mark.parametrize("dt", [0.001, 0.02, 0.1])
@pytest.mark.parametrize("seed", range(8))
def test_the_riccati_weight_is_scipys_and_solves_the_equation(dt, seed):
    rng = np.random.default_rng(seed)
    scales = np.repeat([1.0, 10.0 ** rng.uniform(-6, 0)], 3)
    Q = random_weights(rng, 6) * np.sqrt(np.outer(scales, scales))
    R = random_weights(rng, 3) * 10.0 ** rng.uniform(-6, 1)
    A, B = system = discretise_exact(double_integrator(3), dt)
    P = riccati(system, Q, R)
    gain = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    scale = np.abs(P).max()
    np.testing.assert_allclose(A.T @ P @ (A - B @ gain) + Q, P, atol=1e-9 * scale)
    assert np.abs(np.linalg.eigvals(A - B @ gain)).max() < 1
    np.testing.assert_allclose(P, solve_discrete_are(A, B, Q, R), atol=1e-8 * scale)


@pytest.mark.parametrize("position_weight", [0.0, 1.0])
def test_a_system_that_runs_away_gets_the_weight_that_brings_it_back(position_weight):
    system = StateSpace(np.diag([1.5, 0.5]), np.array([[1.0], [1.0]]))
    Q, R = position_weight * np.eye(2), np.eye(1)
    A, B = system
    P = riccati(system, Q, R)
    gain = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    assert np.abs(np.linalg.eigvals(A - B @ gain)).max() < 1


def test_weights_that_have_no_riccati_solution_are_refused_with_the_cure():
    system = discretise_euler(double_integrator(2), 0.05)
    with pytest.raises(InputError, match="give terminal_weight"):
        riccati(system, np.zeros((4, 4)), np.zeros((2, 2)))


def test_weights_expand_from_parts_components_and_matrices():
    np.testing.assert_array_equal(weight_matrix((2, 3), 2, 2, "w"), np.diag([2, 2, 3, 3]))
    np.testing.assert_array_equal(weight_matrix(5, 1, 3, "w"), 5 * np.eye(3))
    np.testing.assert_array_equal(weight_matrix([1, 2, 3], 1, 3, "w"), np.diag([1, 2, 3]))
    full = random_weights(np.random.default_rng(2), 6)
    np.testing.assert_array_equal(weight_matrix(full, 2, 3, "w"), full)


@pytest.mark.parametrize(
    ("weight", "message"),
    [
        ([1, 2, 3], "shape"),
        (np.ones((2, 3)), "shape"),
        ([1.0, np.nan], "not finite"),
        (np.triu(np.ones((4, 4))), "symmetric"),
        ([1.0, -1.0], "negative eigenvalue"),
    ],
)
def test_bad_weights_are_refused(weight, message):
    with pytest.raises(InputError, match=f"state_weight.*{message}"):
        weight_matrix(weight, 2, 2, "state_weight")

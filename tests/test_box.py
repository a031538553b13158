"""Problems with nothing but bounds: solved whatever is guessed, dependent rows included."""

import numpy as np
import pytest

from arm3dof.control.active_set import solve_by_active_set
from arm3dof.control.box import solve_box
from arm3dof.control.qp import UNBOUNDED, QpSettings, QpStatus, QuadraticProgram
from arm3dof.state import Array


def random_problem(rng: np.random.Generator, n: int, rank: int) -> tuple[Array, Array, Array]:
    """Return H of a rank with a diagonal of 1, g and u of a problem that has an optimum."""
    rows = rng.normal(size=(n, rank))
    rows /= np.linalg.norm(rows, axis=1)[:, np.newaxis]
    reached = rows @ rng.normal(size=rank)  # the rows can all be kept: the dual is bounded
    g = reached + rng.exponential(size=n) * (rng.random(n) < 0.5) - rows @ rng.normal(size=rank)
    return rows @ rows.T, g, rng.choice([1.0, UNBOUNDED], n)


def test_box_problems_are_solved_whatever_is_guessed():
    rng, settings = np.random.default_rng(6), QpSettings()
    for _ in range(200):
        n = int(rng.integers(1, 30))
        rows = rng.normal(size=(n, n + 3))
        H = rows @ rows.T / n
        scale = 1 / np.sqrt(H.diagonal())
        H *= scale * scale[:, np.newaxis]
        g, u = 3 * rng.normal(size=n), rng.choice([1.0, 1e20], n)
        solution = solve_box(H, g, u, rng.random(n) < rng.random(), settings)
        assert solution.status is QpStatus.SOLVED
        qp = QuadraticProgram(H, g, np.eye(n), np.zeros(n), u)
        assert solution.kkt_residual(qp) < 1e-6
        again = solve_box(H, g, u, np.ones(n, dtype=bool), settings)
        np.testing.assert_allclose(solution.x, again.x, atol=1e-5)


def test_dependent_rows_are_solved_and_the_same_to_the_last_bit():
    rng, settings, moved = np.random.default_rng(7), QpSettings(), []
    for _ in range(20):
        n = int(rng.integers(10, 90))
        H, g, u = random_problem(rng, n, n // 3)
        inside = rng.random(n) < 0.5
        solution = solve_box(H, g, u, inside, settings)
        assert solution.status is QpStatus.SOLVED
        gradient = H @ solution.x + g
        assert np.abs(solution.x - np.clip(solution.x - gradient, 0.0, u)).max() < 1e-7
        moved.append(np.empty(int(rng.integers(5000))))  # other places in memory
        again = solve_box(H.copy(), g.copy(), u, inside, settings)
        np.testing.assert_array_equal(solution.x, again.x)


@pytest.mark.parametrize("guess", [True, False])
def test_a_hessian_that_is_not_finite_is_never_solved(guess):
    H = np.eye(3)
    H[2, 1] = H[1, 2] = np.nan
    for g in (np.ones(3), -np.ones(3)):
        solution = solve_box(H, g, np.ones(3), [guess] * 3, QpSettings())
        assert solution.status is QpStatus.NOT_FINITE


def test_rows_that_no_point_satisfies_are_found_out():
    H = np.array([[1.0, -1.0], [-1.0, 1.0]])  # w <= -1 and -w <= -1
    x, status = solve_by_active_set(H, -np.ones(2), np.full(2, UNBOUNDED), 1e-8, 100)
    assert status is QpStatus.UNBOUNDED
    assert np.isfinite(x).all()


@pytest.mark.parametrize("most_steps", [0, 1, 3])
def test_a_cap_on_the_steps_ends_inside_the_bounds(most_steps):
    H, g, u = random_problem(np.random.default_rng(8), 30, 40)
    x, status = solve_by_active_set(H, g, u, 1e-8, most_steps)
    assert status is QpStatus.ITERATION_LIMIT
    assert ((x >= 0) & (x <= u)).all()


def test_proxqp_is_asked_where_the_steps_do_not_suffice():
    H, g, u = random_problem(np.random.default_rng(9), 60, 80)
    x, status = solve_by_active_set(H, g, u, 1e-8, QpSettings(max_iterations=1).most_steps)
    assert status is QpStatus.ITERATION_LIMIT
    solution = solve_box(H, g, u, np.zeros(60, dtype=bool), QpSettings())
    assert solution.status is QpStatus.SOLVED
    few = QpSettings(max_iterations=1)
    assert solve_box(H, g, u, x > 0, few).status in (QpStatus.SOLVED, QpStatus.ITERATION_LIMIT)


def test_a_box_problem_that_is_not_finite_is_refused():
    inside = np.ones(2, dtype=bool)
    bad = solve_box(np.full((2, 2), np.nan), -np.ones(2), np.ones(2), inside, QpSettings())
    assert bad.status is QpStatus.NOT_FINITE

"""The QP workspace: certified optima, honest statuses, no memory of a bad problem."""

import numpy as np
import pytest

from arm3dof.control.qp import (
    UNBOUNDED,
    ProxqpWorkspace,
    QpSettings,
    QpStatus,
    QuadraticProgram,
)
from arm3dof.errors import InputError


def random_qp(rng: np.random.Generator, n: int, m: int) -> QuadraticProgram:
    """A feasible problem with bounded condition number and about half of its rows active."""
    basis, _ = np.linalg.qr(rng.normal(size=(n, n)))
    hessian = basis * np.logspace(0, rng.uniform(0, 4), n) @ basis.T
    rows = rng.normal(size=(m, n))
    inside = rows @ rng.normal(size=n)
    width = rng.exponential(0.5, size=(2, m))
    return QuadraticProgram(
        (hessian + hessian.T) / 2,
        10 * rng.normal(size=n),
        rows,
        inside - width[0],
        inside + width[1],
    )


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 7), (20, 20), (40, 60)])
@pytest.mark.parametrize("same_hessian", [False, True])
def test_solutions_satisfy_the_kkt_conditions(n, m, same_hessian):
    rng = np.random.default_rng(n + 100 * m)
    workspace = ProxqpWorkspace(n, m)
    first = random_qp(rng, n, m)
    for _ in range(20):
        qp = random_qp(rng, n, m)
        if same_hessian:
            qp = qp._replace(H=first.H)
        solution = workspace.solve(qp, same_hessian=same_hessian)
        assert solution.status is QpStatus.SOLVED
        assert solution.kkt_residual(qp) < 1e-6


def test_the_kkt_residual_sees_each_kind_of_error():
    qp = QuadraticProgram(
        np.eye(2), np.array([-2.0, 0.0]), np.eye(2), np.full(2, -1.0), np.full(2, 1.0)
    )
    good = ProxqpWorkspace(2, 2).solve(qp)
    np.testing.assert_allclose(good.x, [1.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(good.z, [1.0, 0.0], atol=1e-7)
    assert good.kkt_residual(qp) < 1e-7
    wrong = {"x": np.array([1.5, 0.0]), "z": np.array([0.5, 0.0])}
    for name, value in wrong.items():
        broken = type(good)(**{**vars(good), name: value})
        assert broken.kkt_residual(qp) > 0.4
    slack_with_price = type(good)(**{**vars(good), "x": np.zeros(2), "z": np.array([2.0, 0.0])})
    assert slack_with_price.kkt_residual(qp) == pytest.approx(2.0)


def test_a_problem_without_rows_active_is_solved_in_closed_form():
    rng = np.random.default_rng(3)
    qp = random_qp(rng, 12, 5)._replace(lower=np.full(5, -UNBOUNDED), upper=np.full(5, UNBOUNDED))
    solution = ProxqpWorkspace(12, 5).solve(qp)
    np.testing.assert_allclose(solution.x, -np.linalg.solve(qp.H, qp.g), atol=1e-7)


def test_infeasible_not_finite_and_capped_problems_say_so_and_leave_no_trace():
    rng = np.random.default_rng(4)
    n, m = 8, 10
    good = random_qp(rng, n, m)
    expected = ProxqpWorkspace(n, m).solve(good).x
    workspace = ProxqpWorkspace(n, m)
    rows = np.vstack([good.C[:-1], good.C[:1]])
    contradiction = good._replace(
        C=rows,
        lower=np.r_[good.lower[:-1], good.upper[0] + 1],
        upper=np.r_[good.upper[:-1], good.upper[0] + 2],
    )
    for _ in range(3):
        assert workspace.solve(contradiction).status in (
            QpStatus.INFEASIBLE,
            QpStatus.ITERATION_LIMIT,
        )
        np.testing.assert_allclose(workspace.solve(good).x, expected, atol=1e-7)
        for part in good._fields:
            broken = np.array(getattr(good, part))
            broken.flat[0] = np.nan
            answer = workspace.solve(good._replace(**{part: broken}))
            assert answer.status is QpStatus.NOT_FINITE
            assert np.isnan(answer.x).all()
        np.testing.assert_allclose(workspace.solve(good).x, expected, atol=1e-7)


def test_an_iteration_cap_of_one_is_reported():
    rng = np.random.default_rng(5)
    workspace = ProxqpWorkspace(30, 40, QpSettings(max_iterations=1, tolerance=1e-12))
    statuses = {workspace.solve(random_qp(rng, 30, 40)).status for _ in range(5)}
    assert QpStatus.ITERATION_LIMIT in statuses


def test_sizes_and_settings_are_checked():
    qp = random_qp(np.random.default_rng(6), 3, 2)
    with pytest.raises(InputError, match="2 rows and 3 variables; this workspace takes 4 and 3"):
        ProxqpWorkspace(3, 4).solve(qp)
    with pytest.raises(InputError, match="tolerance is 0"):
        QpSettings(tolerance=0)
    with pytest.raises(InputError, match="max_iterations is 0"):
        QpSettings(max_iterations=0)

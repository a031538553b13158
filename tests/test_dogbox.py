"""Bounded least squares: SciPy's answers, inside the bounds, within the given work."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares as scipys

from arm3dof.model.dogbox import least_squares


class Waves:
    """Residuals A x + B sin(2 x) - c, which have several minima."""

    def __init__(self, rng, size=3, unknowns=5):
        self.linear, self.waves = rng.normal(size=(2, size, unknowns))
        self.wanted = rng.normal(size=size) * 3
        self.computed = 0

    def residual(self, x):
        self.computed += 1
        return self.linear @ x + self.waves @ np.sin(2 * x) - self.wanted

    def jacobian(self, x):
        return self.linear + 2 * self.waves * np.cos(2 * x)


def problem(rng, walls):
    start = rng.uniform(-1, 1, 5)
    high = np.where(rng.random(5) < walls, start + rng.exponential(0.5, 5), np.inf)
    low = np.where(rng.random(5) < walls, start - rng.exponential(0.5, 5), -np.inf)
    if rng.random() < 0.5 and np.isfinite(high[0]):
        start[0] = high[0]
    return Waves(rng), start, (low, high)


@pytest.mark.parametrize("walls", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("gain", "most"), [(1e-3, 40), (1e-15, 9)])
def test_it_goes_the_way_that_scipy_goes(walls, gain, most):
    rng = np.random.default_rng(0)
    at_walls = 0
    for _ in range(40):
        waves, start, bounds = problem(rng, walls)
        x, left = least_squares(
            waves.residual, waves.jacobian, start, bounds, least_gain=gain, most_residuals=most
        )
        ours, waves.computed = waves.computed, 0
        theirs = scipys(
            waves.residual,
            start,
            waves.jacobian,
            bounds=bounds,
            method="dogbox",
            xtol=1e-15,
            ftol=gain,
            gtol=1e-15,
            max_nfev=most,
        )
        assert_allclose(x, theirs.x, atol=1e-9)
        assert_allclose(left, theirs.fun, atol=1e-9)
        assert ours <= most
        assert abs(ours - theirs.nfev) <= 1  # at the end rounding decides
        assert ((bounds[0] <= x) & (x <= bounds[1])).all()
        at_walls += ((x == bounds[0]) | (x == bounds[1])).any()
    assert (at_walls > 10) == (walls > 0)


def test_what_is_left_is_that_of_the_answer_and_the_start_is_kept():
    rng = np.random.default_rng(1)
    waves, start, bounds = problem(rng, 0.5)
    before = start.copy()
    x, left = least_squares(
        waves.residual, waves.jacobian, start, bounds, least_gain=1e-15, most_residuals=60
    )
    assert_array_equal(start, before)
    assert_array_equal(left, waves.residual(x))


def test_one_residual_is_the_start():
    rng = np.random.default_rng(2)
    waves, start, bounds = problem(rng, 0.5)
    x, left = least_squares(
        waves.residual, waves.jacobian, start, bounds, least_gain=1e-3, most_residuals=1
    )
    assert_array_equal(x, start)
    assert_array_equal(left, waves.residual(start))

"""Gains for joint controllers, found as by hand: try a gain, look at the cost, keep the better.

The cost is the one that ``MpcController`` minimises with its default weights, so that every
controller is asked for the same compromise between error and effort. A trial is a move of an arm
whose configuration is frozen, so that many run at once:

    M a + D v + G dq = tau - g,    tau = Kp e + Kd v_e + Ki integral(e) [+ g + G dq], clipped,

with M, g and G = dg/dq taken at a sampled configuration and torques held over each sample, as the
controller holds them (zero-order hold, exact). The search starts at the gains of a joint of some
bandwidth w on its typical inertia m, Kp = m w^2 and Kd = 1.2 w m, and then turns one gain of one
joint at a time up or down, by ever smaller factors, as long as that helps.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from arm3dof.control.formulation import Weights
from arm3dof.control.prediction import StateSpace, discretise_exact
from arm3dof.control.settings import MpcSettings
from arm3dof.model.robot import Robot
from arm3dof.state import Array, frozen_array

_CONFIGURATIONS = 40
_MOVE = 0.5  # [rad]: the move of every joint in a trial
_SECONDS = 4.0  # length of a trial
_WORST = 1.0  # [rad^2]: a trial that costs this much more or less is as good as lost
_BANDWIDTHS = (6.0, 10.0)  # [rad/s]
_RATES = (0.5, 1.5)  # Ki / Kp [1/s]
_FACTORS = (2.0, 1.4, 1.2, 1.1)
_LEAST_GAIN = 1e-6  # improvement for which a change is kept
_MOST_TRIALS = 600


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of a joint controller.

    Attributes:
        position: Kp, shape (nv,) [N m/rad].
        velocity: Kd, shape (nv,) [N m s/rad].
        integral: Ki, shape (nv,) [N m/(rad s)].
    """

    position: Array
    velocity: Array
    integral: Array

    def __post_init__(self) -> None:
        nv = len(self.position)
        for name in ("position", "velocity", "integral"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), nv, name=name))


def tune_gains(
    robot: Robot, dt: float, *, carries_weight: bool = False, integrates: bool = False
) -> Gains:
    """Find the gains of a PD or PID controller for a robot and a sampling time.

    Args:
        robot: the robot.
        dt: sampling time [s].
        carries_weight: whether the controller adds g(q).
        integrates: whether it has an integral part; without one the integral gains are zero.
    """
    trials = FrozenArms(robot, dt, carries_weight=carries_weight)

    def cost(logarithms: Array) -> float:
        return trials.cost(_gains(logarithms, robot.nv))

    found = []
    for bandwidth, rate in itertools.product(_BANDWIDTHS, _RATES if integrates else (None,)):
        start = [trials.inertia * bandwidth**2, 1.2 * trials.inertia * bandwidth]
        if rate is not None:
            start.append(np.full(robot.nv, rate))
        found.append(_search(cost, np.log(np.concatenate(start))))
    best = min(found, key=lambda result: result[0])
    return _gains(best[1], robot.nv)


class FrozenArms:
    """Trials on arms that are linear about sampled configurations.

    Attributes:
        inertia: typical inertia about each joint, the geometric mean, shape (nv,) [kg m^2].
    """

    def __init__(self, robot: Robot, dt: float, *, carries_weight: bool) -> None:
        """Freeze a robot in some configurations, the same ones each time."""
        rng, nv = np.random.default_rng(0), robot.nv
        data, masses, systems, weight, stiffness = robot.model.createData(), [], [], [], []
        for _ in range(_CONFIGURATIONS):
            q = robot.random_configuration(rng)
            masses.append(robot.mass_matrix(q))
            weight.append(robot.gravity(q))
            slope = pin.computeGeneralizedGravityDerivatives(robot.model, data, q)
            stiffness.append(np.array(slope).reshape(nv, nv))
            inverse = np.linalg.inv(masses[-1])
            A, B = np.zeros((2 * nv, 2 * nv)), np.zeros((2 * nv, nv))
            A[:nv, nv:], B[nv:] = np.eye(nv), inverse
            A[nv:] = -inverse @ np.hstack([stiffness[-1], np.diag(robot.damping)])
            systems.append(discretise_exact(StateSpace(A, B), dt))
        self.inertia = np.exp(np.log(np.diagonal(masses, axis1=1, axis2=2)).mean(axis=0))
        self._dt, self._tau_max, self._carries = dt, robot.limits.tau_max, carries_weight
        self._A, self._B = (np.array(part) for part in zip(*systems, strict=True))
        self._weight, self._stiffness = np.array(weight), np.array(stiffness)
        self._move = rng.choice([-_MOVE, _MOVE], (_CONFIGURATIONS, nv))
        weights = Weights(MpcSettings(dt=dt), 1)
        self._of_error, self._of_input = float(weights.Q[0, 0]), float(weights.R[0, 0])

    def cost(self, gains: Gains) -> float:
        """Return the mean cost of a move, from 0 (free) to 1 (every trial lost)."""
        nv, dt = self._move.shape[1], self._dt
        x = np.zeros((_CONFIGURATIONS, 2 * nv))
        integral, integrates = np.zeros_like(self._move), bool(gains.integral.any())
        of_errors, of_inputs = np.zeros((2, *self._move.shape))
        steps = round(_SECONDS / dt)
        with np.errstate(all="ignore"):  # an unstable trial may overflow; it is lost either way
            for _ in range(steps):
                q, v = x[:, :nv], x[:, nv:]
                e = self._move - q
                asked = gains.position * e - gains.velocity * v
                if self._carries:
                    asked += self._weight + _times(self._stiffness, q)
                if integrates:
                    asked += integral
                tau = np.minimum(np.maximum(asked, -self._tau_max), self._tau_max)
                if integrates:
                    winds_up = (asked != tau) & (e * asked > 0)
                    integral = integral + np.where(winds_up, 0.0, dt * gains.integral * e)
                x = _times(self._A, x) + _times(self._B, tau - self._weight)
                change = x[:, nv:] - v
                of_errors += e * e
                of_inputs += change * change
            total = self._of_error * of_errors + self._of_input / dt**2 * of_inputs
            mean = total.mean(axis=1) / steps
            lost = mean / (mean + _WORST * self._of_error)
        return float(np.nan_to_num(lost, nan=1.0).mean())


def _times(matrices: Array, vectors: Array) -> Array:
    product: Array = (matrices @ vectors[..., np.newaxis])[..., 0]
    return product


def _gains(logarithms: Array, nv: int) -> Gains:
    """Return gains from the logarithms of Kp, Kd and, where there is one, Ki / Kp."""
    position, velocity, *rate = np.exp(logarithms).reshape(-1, nv)
    integral = rate[0] * position if rate else np.zeros(nv)
    return Gains(position, velocity, integral)


def _search(cost: Callable[[Array], float], x: Array) -> tuple[float, Array]:
    """Move along one coordinate at a time as long as the cost falls, in ever smaller steps."""
    least, trials = cost(x), 1
    for factor in _FACTORS:
        improved = True
        while improved and trials < _MOST_TRIALS:
            improved = False
            for index, step in itertools.product(range(x.size), (np.log(factor), -np.log(factor))):
                tried = x.copy()
                tried[index] += step
                at, trials = cost(tried), trials + 1
                if at < least - _LEAST_GAIN:
                    x, least, improved = tried, at, True
    return least, x

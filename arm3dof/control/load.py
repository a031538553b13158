"""What the arm carries, learned from how it moves: a mass at the tool, and masses that are wrong.

For any motion the inverse dynamics is linear in masses, so the torque that the nominal model does
not explain is

    r = tau_applied - tau_nominal = m y + s tau_rigid - d,

with m the mass at the tool, y the torque that a unit mass takes there, s the common relative error
of all masses, and d what else acts. m and s are estimated by recursive least squares with
exponential forgetting and a prior around zero (Ljung 1999, section 11.2).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof.model.robot import Robot
from arm3dof.state import Array

_FORGET = 0.85  # weight of the past in each step
_MASS_ERROR_PRIOR = 0.3  # standard deviation of s
_LOAD_PRIOR = 0.25  # standard deviation of m, as a share of the load that stalls a joint
_TORQUE_NOISE = 0.02  # standard deviation of r, as a share of the torque limit
_MASS_ERROR_RANGE = (-0.6, 1.5)
_SAME = 2e-2  # a smaller change of s, or of m as a share of the most, is left to the disturbance,
_SAME_PER_TURN = 0.1  # [1/rad]: and one of so much more where a joint turned far in the sample


class LoadEstimator:
    """Estimates the load and the mass error, and teaches them to a robot.

    Attributes:
        load: estimated mass at the tool beyond the nominal model [kg].
        mass_error: estimated relative error of all masses.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """Create an estimator.

        Args:
            robot: the robot that is taught, as nominal as it is now; the controller's own.
            dt: length of the motions that will be looked at [s].
        """
        self._robot, self._nominal, self._dt = robot, robot.clone(), dt
        nominal = self._nominal
        self._unit = nominal.with_payload((nominal.payload.mass if nominal.payload else 0.0) + 1.0)
        # bodies are linear in the two unknowns: 1 + s of their masses, m of what a unit load adds
        self._masses = _parameters(nominal)
        self._unit_load = _parameters(self._unit) - self._masses
        self._data = self._nominal.model.createData()
        self._unit_data = self._unit.model.createData()
        limits = nominal.limits
        scale = np.where(limits.tau_max > 0, limits.tau_max, 1.0)
        self._weights = ((_TORQUE_NOISE * scale) ** -2.0).tolist()
        self._damping = nominal.damping.tolist()
        per_kilogram = max(float((self._heaviest() / scale).max()), 1e-6)
        self._most_load = 1.0 / per_kilogram
        self._load_prior = (_LOAD_PRIOR * self._most_load) ** -2.0
        self._error_prior = _MASS_ERROR_PRIOR**-2.0
        self._taught = 0.0, 0.0
        # of the last motion, joint by joint: the torque that a unit load and the nominal masses
        # take, and r; plain numbers, for arrays this small cost more than what is done with them
        self._motion = [(0.0, 0.0, 0.0)] * nominal.nv
        self._speeds = [0.0] * nominal.nv
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.load, self.mass_error = 0.0, 0.0
        self._normal = (0.0,) * 5

    def look(
        self, q: list[float], v: list[float], a: list[float], tau: Array, beside: Array
    ) -> tuple[list[float], list[float]]:
        """Look at a motion of the arm, from which ``learn`` may learn.

        Args:
            q: position in the middle of the motion, of each joint [rad].
            v: mean velocity [rad/s].
            a: mean acceleration [rad/s^2].
            tau: torque that acted, friction compensation taken off, shape (nv,) [N m].
            beside: torque that acts beside it and is known, shape (nv,) [N m].

        Returns:
            The torque that the nominal robot leaves open, of each joint, and what the taught load
            and mass error and ``beside`` leave of that [N m].
        """
        motion = np.array(q), np.array(v), np.array(a)
        nominal = pin.rnea(self._nominal.model, self._data, *motion).tolist()
        loaded = pin.rnea(self._unit.model, self._unit_data, *motion).tolist()
        load, error = self._taught
        unexplained, left, seen = [], [], []
        joints = zip(nominal, loaded, tau.tolist(), self._damping, v, beside.tolist())
        for rigid, unit, applied, damping, speed, known in joints:
            r, y = applied - rigid - damping * speed, unit - rigid
            unexplained.append(r)
            left.append(r - load * y - error * rigid + known)
            seen.append((y, rigid, r))
        self._motion, self._speeds = seen, v
        return unexplained, left

    def learn(self) -> None:
        """Learn from the motion that was looked at last."""
        # the normal equations of the two unknowns, in noise units; small enough to write out
        yy, ys, ss, yr, sr = self._normal
        yy, ys, ss, yr, sr = _FORGET * yy, _FORGET * ys, _FORGET * ss, _FORGET * yr, _FORGET * sr
        for (y, s, r), weight in zip(self._motion, self._weights):
            weighed_y, weighed_s = weight * y, weight * s
            yy += weighed_y * y
            ys += weighed_y * s
            ss += weighed_s * s
            yr += weighed_y * r
            sr += weighed_s * r
        self._normal = yy, ys, ss, yr, sr
        yy, ss = yy + self._load_prior, ss + self._error_prior
        determinant = yy * ss - ys * ys
        load = (ss * yr - ys * sr) / determinant
        error = (yy * sr - ys * yr) / determinant
        most = self._most_load
        self.load = load if 0.0 <= load <= most else min(max(load, 0.0), most)
        least, most = _MASS_ERROR_RANGE
        self.mass_error = error if least <= error <= most else min(max(error, least), most)

    def teach(self) -> list[float] | None:
        """Give what was learned to the robot, if it differs from what was taught last.

        Returns:
            How much more of the motion that was looked at last it explains, of each joint [N m];
            ``None`` if it is about the same.
        """
        new, (load, error) = (self.load, self.mass_error), self._taught
        more_load, more_error = new[0] - load, new[1] - error
        if self._is_small(more_load, more_error) and new != (0.0, 0.0):
            return None
        self._taught = new
        bodies = self._masses * (1 + self.mass_error) + self._unit_load * self.load
        self._robot.reweigh(list(map(pin.Inertia.FromDynamicParameters, bodies)))
        return [more_load * y + more_error * s for y, s, _ in self._motion]

    def _is_small(self, more_load: float, more_error: float) -> bool:
        """Whether a change is no more than the last motion may be wrong about.

        The middle of a motion stands for all of it, the worse the farther a joint turns.
        """
        change = max(abs(more_load) / self._most_load, abs(more_error))
        if change < _SAME:
            return True
        return change < _SAME + _SAME_PER_TURN * self._dt * max(map(abs, self._speeds))

    def _heaviest(self) -> Array:
        """Return the largest torque that gravity on a unit load takes, over sampled poses."""
        rng = np.random.default_rng(0)
        poses = [self._nominal.random_configuration(rng) for _ in range(64)]
        extra = [self._unit.gravity(q) - self._nominal.gravity(q) for q in poses]
        return np.asarray(np.abs(extra).max(axis=0))


def _parameters(robot: Robot) -> Array:
    """Return the inertial parameters of all bodies, in which dynamics is linear, (nv, 10)."""
    return np.array([body.toDynamicParameters() for body in robot.bodies])

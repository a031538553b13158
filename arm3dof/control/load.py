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


class LoadEstimator:
    """Estimates the load and the mass error, and gives them to the believed robot.

    Attributes:
        load: estimated mass at the tool beyond the nominal model [kg].
        mass_error: estimated relative error of all masses.
    """

    def __init__(self, nominal: Robot) -> None:
        """Create an estimator that believes the nominal robot.

        Args:
            nominal: the robot as its description says it is.
        """
        self._nominal = nominal.clone()
        self._unit = nominal.with_payload((nominal.payload.mass if nominal.payload else 0.0) + 1.0)
        self._parameters = [body.toDynamicParameters() for body in self._nominal.model.inertias]
        loaded = [body.toDynamicParameters() for body in self._unit.model.inertias]
        self._load_parameters = [b - a for a, b in zip(self._parameters, loaded, strict=True)]
        self._data = self._nominal.model.createData()
        limits = nominal.limits
        scale = np.where(limits.tau_max > 0, limits.tau_max, 1.0)
        self._noise = _TORQUE_NOISE * scale
        per_kilogram = max(float((self._heaviest() / scale).max()), 1e-6)
        self._most_load = 1.0 / per_kilogram
        prior = np.array([_LOAD_PRIOR * self._most_load, _MASS_ERROR_PRIOR])
        self._prior = np.diag(prior**-2.0)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.load, self.mass_error = 0.0, 0.0
        self._information, self._evidence = np.zeros((2, 2)), np.zeros(2)

    def learn(self, q: Array, v: Array, a: Array, tau: Array) -> Array:
        """Learn from a motion and return the torque that remains unexplained, shape (nv,) [N m].

        Args:
            q: position in the middle of the motion, shape (nv,) [rad].
            v: mean velocity, shape (nv,) [rad/s].
            a: mean acceleration, shape (nv,) [rad/s^2].
            tau: torque that acted, friction compensation taken off, shape (nv,) [N m].
        """
        rigid = np.array(pin.rnea(self._nominal.model, self._data, q, v, a))
        unit = np.array(pin.rnea(self._unit.model, self._data, q, v, a))
        unexplained = tau - rigid - self._nominal.damping * v
        regressor = np.stack([unit - rigid, rigid], axis=1)
        weighed = regressor / self._noise[:, np.newaxis]
        self._information = _FORGET * self._information + weighed.T @ weighed
        self._evidence = _FORGET * self._evidence + weighed.T @ (unexplained / self._noise)
        load, error = np.linalg.solve(self._information + self._prior, self._evidence)
        self.load = min(max(float(load), 0.0), self._most_load)
        self.mass_error = min(max(float(error), _MASS_ERROR_RANGE[0]), _MASS_ERROR_RANGE[1])
        return np.asarray(unexplained - regressor @ np.array([self.load, self.mass_error]))

    def teach(self, robot: Robot) -> None:
        """Give what was learned to a robot that belongs to the controller alone."""
        rows = zip(self._parameters, self._load_parameters, strict=True)
        for joint, (own, load) in enumerate(rows):
            if joint > 0:  # joint 0 is the world
                parameters = (1 + self.mass_error) * own + self.load * load
                robot.model.inertias[joint] = pin.Inertia.FromDynamicParameters(parameters)

    def _heaviest(self) -> Array:
        """Return the largest torque that gravity on a unit load takes, over sampled poses."""
        rng = np.random.default_rng(0)
        poses = [self._nominal.random_configuration(rng) for _ in range(64)]
        extra = [self._unit.gravity(q) - self._nominal.gravity(q) for q in poses]
        return np.asarray(np.abs(extra).max(axis=0))

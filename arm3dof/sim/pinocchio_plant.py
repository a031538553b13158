"""The arm as Pinocchio simulates it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState, frozen_array

_STABLE_STEP = 1.0  # RK4 is stable for rate * dt < 2.78; this leaves room for poses not sampled
_FRICTION_SWEEPS = 50
_FRICTION_TOLERANCE = 1e-12  # [rad/s]


class PinocchioPlant:
    """Rigid-body dynamics with joint damping and Coulomb friction.

    Each step integrates M a + C v + g + D v = tau with the classical Runge-Kutta method (RK4),
    in as many substeps as stiff damping needs for stability, and then lets Coulomb friction take
    its share of the momentum: the velocity that minimises the kinetic energy of the change plus
    the friction's work, so that a joint sticks exactly when friction can hold it.

    Attributes:
        robot: the robot that is simulated.
    """

    def __init__(self, robot: Robot, dt: float = 0.001) -> None:
        """Create a plant at the middle of the joint range, at rest.

        Args:
            robot: the robot to simulate.
            dt: time of one step [s].

        Raises:
            InputError: ``dt`` is not positive.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt is {dt!r}; give a positive number of seconds")
        self.robot = robot.clone()
        self._dt = float(dt)
        self._model, self._data = self.robot.model, self.robot.model.createData()
        self._damping = self.robot.damping if self.robot.damping.any() else None
        self._friction = self.robot.friction if self.robot.friction.any() else None
        self._substeps = self._stable_substeps()
        middle = self.robot.limits.q_min / 2 + self.robot.limits.q_max / 2
        self._q = np.where(np.isfinite(middle), middle, 0.0)
        self._v = np.zeros(robot.nv)
        self._t0, self._steps = 0.0, 0

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self._dt

    @property
    def state(self) -> JointState:
        """The present state."""
        return JointState(self._t0 + self._steps * self._dt, self._q, self._v)

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state and return it.

        Raises:
            InputError: the state is not finite or belongs to another robot.
        """
        if state.q.size != self.robot.nv or not state.is_finite:
            raise InputError(
                f"the state is q = {state.q}, v = {state.v}; "
                f"{self.robot.name} needs {self.robot.nv} finite positions and velocities"
            )
        self._t0, self._steps = state.t, 0
        self._q, self._v = np.array(state.q), np.array(state.v)
        return self.state

    def step(self, tau: ArrayLike) -> JointState:
        """Hold a torque for ``dt`` and return the state after it.

        Args:
            tau: torque, shape (nv,) [N m].

        Raises:
            InputError: the torque has another shape or is not finite.
        """
        torque = frozen_array(tau, self.robot.nv, name="tau")
        if not np.isfinite(torque).all():
            raise InputError(f"tau is {torque}; a plant takes finite torques")
        h = self._dt / self._substeps
        for _ in range(self._substeps):
            self._runge_kutta(torque, h)
            if self._friction is not None:
                self._rub(h)
        self._steps += 1
        return self.state

    def energy(self) -> float:
        """Return the mechanical energy of the present state [J]."""
        return float(pin.computeMechanicalEnergy(self._model, self._data, self._q, self._v))

    def _acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        if self._damping is not None:
            tau = tau - self._damping * v
        return np.array(pin.aba(self._model, self._data, q, v, tau))

    def _runge_kutta(self, tau: Array, h: float) -> None:
        q, v = self._q, self._v
        a1 = self._acceleration(q, v, tau)
        v2 = v + h / 2 * a1
        a2 = self._acceleration(q + h / 2 * v, v2, tau)
        v3 = v + h / 2 * a2
        a3 = self._acceleration(q + h / 2 * v2, v3, tau)
        v4 = v + h * a3
        a4 = self._acceleration(q + h * v3, v4, tau)
        self._q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        self._v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def _rub(self, h: float) -> None:
        """Minimise 1/2 |v' - v|_M^2 + h sum_i f_i |v'_i| by coordinate descent."""
        mass = np.array(pin.crba(self._model, self._data, self._q))
        impulse = h * self.robot.friction
        free, v = self._v, self._v.copy()
        for _ in range(_FRICTION_SWEEPS):
            change = 0.0
            for i, limit in enumerate(impulse):
                pull = mass[i, i] * v[i] - mass[i] @ (v - free)
                new = np.sign(pull) * max(abs(pull) - limit, 0.0) / mass[i, i]
                change = max(change, abs(new - v[i]))
                v[i] = new
            if change < _FRICTION_TOLERANCE:
                break
        self._v = v

    def _stable_substeps(self) -> int:
        """Return the substeps that keep RK4 stable for the damping, over sampled poses."""
        if self._damping is None:
            return 1
        rng = np.random.default_rng(0)
        fastest = 0.0
        for _ in range(32):
            mass = self.robot.mass_matrix(self.robot.random_configuration(rng))
            rates = np.linalg.eigvals(np.linalg.solve(mass, np.diag(self._damping)))
            fastest = max(fastest, float(np.abs(rates).max()))
        return max(1, int(np.ceil(fastest * self._dt / _STABLE_STEP)))

"""The arm as Pinocchio simulates it."""

from __future__ import annotations

import math
from operator import mul

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.sim.plant import check_start
from arm3dof.sim.servo import Servo, holding_torque
from arm3dof.state import Array, JointState, finite_vector

_FASTEST_EXPLICIT_DECAY = 0.5  # damping that decays more than this share of a step is stiff
_FRICTION_SWEEPS = 100
_FRICTION_TOLERANCE = 1e-10  # [rad/s]
_FRICTION_LEAP = 3  # after so many sweeps it is guessed which joints slide, and solved for them


class PinocchioPlant:
    """Rigid-body dynamics with joint damping and Coulomb friction.

    Each step integrates M a + C v + g + D v = tau with the classical Runge-Kutta method (RK4).
    Then dry friction takes its share of the momentum: the new velocity v' minimises
    1/2 |v' - v|_M^2 + dt sum_i f_i |v'_i|, so that a joint sticks exactly when friction can hold
    it. Damping too stiff for RK4 (a geared wrist) joins that implicit step as 1/2 dt d_i v'_i^2.
    The position then follows by the trapezoidal rule.

    With end stops a joint does not leave its range: where it would, the same minimum is taken over
    the velocities that stay inside. That is an inelastic impact, and its impulse is felt by the
    other joints. A joint that is outside already may only move back.

    Attributes:
        robot: the robot that is simulated.
    """

    def __init__(
        self,
        robot: Robot,
        dt: float = 0.001,
        *,
        servo: Servo | None = None,
        rng: np.random.Generator | None = None,
        end_stops: bool = False,
    ) -> None:
        """Create a plant at the middle of the joint range, at rest.

        Args:
            robot: the robot to simulate.
            dt: time of one step [s].
            servo: what stands between a command and the joints, and between the joints and their
                measurement; without one motors and encoders are ideal.
            rng: source of the encoders' noise; needed where there is some.
            end_stops: whether joints stop at the ends of their range.

        Raises:
            InputError: ``dt`` is not positive, the servo has another number of joints, or its
                noise has no source.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt is {dt!r}; give a positive number of seconds")
        self._dt, self._end_stops = float(dt), end_stops
        self._drive = None if servo is None else servo.drive(robot, self._dt, rng)
        self._simulate(robot)
        middle = self.robot.limits.q_min / 2 + self.robot.limits.q_max / 2
        self._q = np.where(np.isfinite(middle), middle, 0.0)
        self._v = np.zeros(robot.nv)
        self._applied = finite_vector(np.zeros(robot.nv), robot.nv, "tau")
        self._t0, self._steps = 0.0, 0
        self._seen: JointState | None = None
        self._start_servos()

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self._dt

    @property
    def state(self) -> JointState:
        """The present state."""
        if self._seen is None:
            self._seen = JointState.adopt(self._t0 + self._steps * self._dt, self._q, self._v)
        return self._seen

    @property
    def applied_torque(self) -> Array:
        """The torque of the last step, shape (nv,) [N m]; zero before the first."""
        return self._applied

    def measure(self) -> JointState:
        """Return the present state as the servos' encoders tell it; without servos, as it is."""
        return self.state if self._drive is None else self._drive.measure(self.state)

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state and return it.

        Raises:
            InputError: the state is not finite or belongs to another robot.
        """
        check_start(self.robot, state)
        self._t0, self._steps, self._seen = state.t, 0, None
        self._q, self._v = np.array(state.q), np.array(state.v)
        self._applied = finite_vector(np.zeros(self.robot.nv), self.robot.nv, "tau")
        self._start_servos()
        return self.state

    def step(
        self,
        tau: ArrayLike,
        *,
        external_torque: ArrayLike | None = None,
        tool_wrench: ArrayLike | None = None,
    ) -> JointState:
        """Hold a torque for ``dt`` and return the state after it.

        Args:
            tau: torque of the motors, or what the servos are commanded, shape (nv,) [N m].
            external_torque: torque that the surroundings add at the joints, shape (nv,) [N m].
            tool_wrench: force [N] and torque [N m] on the tool in base axes, shape (6,); it is
                held while the tool moves.

        Raises:
            InputError: a torque or the wrench has another shape or is not finite.
        """
        applied = finite_vector(tau, self.robot.nv, "tau")
        if self._drive is not None:
            applied = self._drive.torque(applied, self._v)
            applied.flags.writeable = False
        torque, wrench = applied, None
        if external_torque is not None:
            torque = applied + finite_vector(external_torque, self.robot.nv, "external_torque")
        if tool_wrench is not None:
            wrench = finite_vector(tool_wrench, 6, "tool_wrench")
        q, v = self._runge_kutta(torque, wrench)
        stops = self._end_stops and self._leaves_range(q)
        if self._rubs or stops:
            v = self._rub(v)
            q = self._q + self._dt / 2 * (self._v + v)
        if stops:
            limits = self.robot.limits
            q = np.clip(q, np.minimum(limits.q_min, self._q), np.maximum(limits.q_max, self._q))
        self._q, self._v, self._applied = q, v, applied
        self._steps, self._seen = self._steps + 1, None
        self.measure()  # the encoders read every step, whether or not anybody asks
        return self.state

    def displace(self, change: ArrayLike) -> JointState:
        """Move the joints at once, with their velocities as they are, and return the state.

        Args:
            change: what is added to the positions, shape (nv,) [rad].

        Raises:
            InputError: the change has another shape or is not finite.
        """
        self._q = self._q + finite_vector(change, self.robot.nv, "change")
        self._seen = None
        return self.state

    def change_robot(self, robot: Robot) -> None:
        """Go on with another robot of as many joints, such as one that took up a payload.

        Time, positions and velocities stay as they are.

        Raises:
            InputError: the robot has another number of joints.
        """
        if robot.nv != self.robot.nv:
            raise InputError(
                f"{robot.name} has {robot.nv} joints; this plant goes on with {self.robot.nv}"
            )
        self._simulate(robot)

    def energy(self) -> float:
        """Return the mechanical energy of the present state [J]."""
        return float(pin.computeMechanicalEnergy(self._model, self._data, self._q, self._v))

    def _simulate(self, robot: Robot) -> None:
        self.robot = robot.clone()
        self._model, self._data = self.robot.model, self.robot.model.createData()
        self._friction, self._damping = self.robot.friction, self.robot.damping
        if self._drive is not None:
            self._friction = self._friction + self._drive.friction
            self._damping = self._damping + self._drive.damping
        stiff = self._has_stiff_damping()
        none = np.zeros(robot.nv)
        self._explicit_damping = none if stiff else self._damping
        self._implicit_damping = self._damping if stiff else none
        self._damps = bool(self._explicit_damping.any())
        self._rubs = stiff or bool(self._friction.any())

    def _start_servos(self) -> None:
        if self._drive is not None:
            self._drive.reset(self.state, holding_torque(self.robot, self._q))

    def _acceleration(self, q: Array, v: Array, tau: Array, wrench: Array | None) -> Array:
        net = tau - self._explicit_damping * v if self._damps else tau
        if wrench is not None:
            net = net + self.robot.jacobian(q).T @ wrench
        return np.array(pin.aba(self._model, self._data, q, v, net))

    def _runge_kutta(self, tau: Array, wrench: Array | None) -> tuple[Array, Array]:
        q, v, h = self._q, self._v, self._dt
        half = h / 2
        a1 = self._acceleration(q, v, tau, wrench)
        v2 = v + half * a1
        a2 = self._acceleration(q + half * v, v2, tau, wrench)
        v3 = v + half * a2
        a3 = self._acceleration(q + half * v2, v3, tau, wrench)
        a4 = self._acceleration(q + h * v3, v + h * a3, tau, wrench)
        middle = a2 + a3
        return q + h * (v + h / 6 * (a1 + middle)), v + h / 6 * (a1 + 2 * middle + a4)

    def _leaves_range(self, q: Array) -> bool:
        limits = self.robot.limits
        return bool(((q < limits.q_min) | (q > limits.q_max)).any())

    def _rub(self, free: Array) -> Array:
        """Return the velocity after friction, stiff damping and stops, by coordinate descent.

        Now and then all joints that slide are moved at once to where they balance.
        """
        h, nothing = self._dt, np.full(free.size, np.inf)
        mass = np.array(pin.crba(self._model, self._data, self._q))
        dry = (h * self._friction).tolist()
        momentum = (mass @ free).tolist()
        mass[np.diag_indices_from(mass)] += h * self._implicit_damping
        inertia, coupling = mass.diagonal().tolist(), mass.tolist()
        for i, row in enumerate(coupling):
            row[i] = 0.0
        limits, least, most = self.robot.limits, -nothing, nothing
        if self._end_stops:
            least = np.minimum((limits.q_min - self._q) / h, 0.0)
            most = np.maximum((limits.q_max - self._q) / h, 0.0)
        slowest, fastest = least.tolist(), most.tolist()
        v = free.tolist()  # of a few joints Python's numbers are ten times as fast as arrays
        for sweep in range(1, _FRICTION_SWEEPS + 1):
            change = 0.0
            for i, limit in enumerate(dry):
                pull = momentum[i] - sum(map(mul, coupling[i], v))
                new = math.copysign(max(abs(pull) - limit, 0.0), pull) / inertia[i]
                new = min(max(new, slowest[i]), fastest[i])
                change = max(change, abs(new - v[i]))
                v[i] = new
            if change < _FRICTION_TOLERANCE:
                break
            if sweep % _FRICTION_LEAP == 0:
                v = _leap(mass, momentum, dry, v, slowest, fastest)
        return np.array(v)

    def _has_stiff_damping(self) -> bool:
        """Whether damping decays too fast for RK4, in the fastest of some sampled poses."""
        if not self._damping.any():
            return False
        rng = np.random.default_rng(0)
        poses = [self.robot.random_configuration(rng) for _ in range(32)]
        masses = np.array([self.robot.mass_matrix(q) for q in poses])
        rates = np.linalg.eigvals(np.linalg.solve(masses, np.diag(self._damping)))
        return float(np.abs(rates).max()) * self._dt > _FASTEST_EXPLICIT_DECAY


def _leap(
    mass: Array,
    momentum: list[float],
    dry: list[float],
    v: list[float],
    slowest: list[float],
    fastest: list[float],
) -> list[float]:
    """Return the velocities at which sliding joints balance, where they go on sliding that way.

    Args:
        mass: what resists each joint's motion, shape (n, n) [kg m^2].
        momentum: of each joint before friction [N m s].
        dry: the most that dry friction takes of it [N m s].
        v: velocities so far [rad/s].
        slowest: the least that each may be [rad/s].
        fastest: the greatest that each may be [rad/s].
    """
    slides = [i for i, w in enumerate(v) if w != 0.0 and slowest[i] < w < fastest[i]]
    pull = np.array([momentum[i] - math.copysign(dry[i], v[i]) for i in slides])
    others = np.array(v)
    others[slides] = 0.0
    balance = np.linalg.solve(mass[np.ix_(slides, slides)], pull - mass[slides] @ others).tolist()
    leapt = list(v)
    for i, w in zip(slides, balance, strict=True):
        if w * v[i] <= 0.0 or not slowest[i] <= w <= fastest[i]:
            return v
        leapt[i] = w
    return leapt

"""The controllers that MPC is measured against: PD, PD + gravity, PID and computed torque.

All run once a sample, as MPC does, and hold their torque in between. With e = q_target - q and
v_e = v_target - v, clipped to the torque limits:

    PD               tau = Kp e + Kd v_e
    PD + gravity     tau = Kp e + Kd v_e + g(q)
    PID              tau = Kp e + Kd v_e + Ki integral(e)
    computed torque  tau = M(q) (a_target + k_p e + k_d v_e) + C(q, v) v + g(q) + friction

Kp, Kd and Ki come from ``tune_gains``, k_p and k_d from ``MpcSettings``' weights.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from arm3dof.control.formulation import Weights, damping_share, discretise
from arm3dof.control.prediction import double_integrator, riccati
from arm3dof.control.reference import Target, sample_target
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.control.tuning import Gains, tune_gains
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState


@dataclass(frozen=True, eq=False)
class Situation:
    """What a law decides upon, finite throughout.

    Attributes:
        q: measured positions, shape (nv,) [rad].
        v: measured velocities, shape (nv,) [rad/s].
        e: error q_target - q, shape (nv,) [rad].
        v_e: error of the velocities, shape (nv,) [rad/s].
        a_target: the target's acceleration over the coming sample, shape (nv,) [rad/s^2].
    """

    q: Array
    v: Array
    e: Array
    v_e: Array
    a_target: Array


class Law(Protocol):
    """A feedback law: an error in, a torque out."""

    def torque(self, now: Situation) -> Array:
        """Return the torque that the law asks for, not yet limited, shape (nv,) [N m]."""

    def given(self, now: Situation, asked: Array, given: Array) -> None:
        """Learn which torque was given, shape (nv,) [N m]: at its limits less than asked for."""

    def reset(self) -> None:
        """Forget the past."""


class BaselineController:
    """A feedback law as a ``Controller``: always a finite torque inside its limits.

    ``status`` is ``SOLVED`` where the law gave the torque. A measurement that is not finite, or so
    large that no finite torque follows from it, is ``BAD_MEASUREMENT``: the arm is held against
    gravity where it was last seen, or let go when it was never seen. A target that is not finite
    is ``BAD_TARGET``: the arm is held where it is.

    Attributes:
        robot: the robot that is controlled.
        law: the feedback law.
    """

    def __init__(self, robot: Robot, law: Law, dt: float = MpcSettings.dt) -> None:
        """Create a controller.

        Args:
            robot: the robot; a copy of it is kept.
            law: the feedback law.
            dt: time between two steps [s].

        Raises:
            InputError: ``dt`` is not positive.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt is {dt!r}; give a positive number of seconds")
        self.robot, self.law = robot.clone(), law
        self._dt = float(dt)
        self.reset()

    @property
    def dt(self) -> float:
        """Time between two steps [s]."""
        return self._dt

    def reset(self) -> None:
        """Forget the past: the next step is as if it were the first."""
        self.law.reset()
        self._seen: Array | None = None

    def step(self, state: JointState, target: Target) -> ControlStep:
        """Return the torque to apply until the next step.

        Args:
            state: measured state.
            target: constant target, shape (nv,) [rad], or a trajectory.

        Raises:
            InputError: the state or the target belongs to a robot with another number of joints.
        """
        start, robot = time.perf_counter(), self.robot
        if state.q.size != robot.nv:
            raise InputError(f"the state has {state.q.size} joints; {robot.name} has {robot.nv}")
        reference = sample_target(target, robot.nv, state.t, self._dt, 1)
        q_target, v_target = reference.q[0], reference.v[0]
        if not state.is_finite:
            return self._hold(state, q_target, ControlStatus.BAD_MEASUREMENT, start)
        if not np.isfinite(reference.q).all():
            self._seen = state.q
            return self._hold(state, q_target, ControlStatus.BAD_TARGET, start)
        a_target = (reference.v[-1] - v_target) / self._dt
        with np.errstate(all="ignore"):  # an absurd state overflows; it is answered below
            now = Situation(state.q, state.v, q_target - state.q, v_target - state.v, a_target)
            asked = self.law.torque(now)
            tau = self._limited(asked)
            u = self._acceleration(state, tau)
        if not (np.isfinite(asked).all() and np.isfinite(u).all()):
            return self._hold(state, q_target, ControlStatus.BAD_MEASUREMENT, start)
        self._seen = state.q
        self.law.given(now, asked, tau)
        plan = np.concatenate([now.e, state.v])[np.newaxis]
        return _answer(tau, u, plan, ControlStatus.SOLVED, TorqueSource.OPTIMUM, start)

    def _hold(
        self, state: JointState, q_target: Array, status: ControlStatus, start: float
    ) -> ControlStep:
        """Hold the arm where it was last seen."""
        still = np.zeros(self.robot.nv)
        believed = still if self._seen is None else self._seen
        tau = still if self._seen is None else self._limited(self.robot.gravity(believed))
        plan = np.concatenate([q_target - believed, still])[np.newaxis]
        return _answer(tau, still, plan, status, TorqueSource.BRAKING, start)

    def _limited(self, tau: Array) -> Array:
        limit = self.robot.limits.tau_max
        return np.clip(np.nan_to_num(tau, posinf=np.inf, neginf=-np.inf), -limit, limit)

    def _acceleration(self, state: JointState, tau: Array) -> Array:
        """Return the acceleration that the model expects, the u of (22), shape (nv,)."""
        return self.robot.forward_dynamics(state.q, state.v, tau)


def _answer(
    tau: Array, u: Array, plan: Array, status: ControlStatus, source: TorqueSource, start: float
) -> ControlStep:
    for array in (tau, u, plan):
        array.flags.writeable = False
    return ControlStep(tau, u, plan, status, source, time.perf_counter() - start)


class PdLaw:
    """Kp e + Kd v_e, and g(q) where a robot is given."""

    def __init__(self, gains: Gains, weighed: Robot | None = None) -> None:
        """Create the law.

        Args:
            gains: its gains; the integral one is not used.
            weighed: the robot whose weight is carried; ``None`` leaves it to the error.
        """
        self.gains, self._weighed = gains, weighed

    def torque(self, now: Situation) -> Array:
        """Return the torque that the law asks for, shape (nv,) [N m]."""
        tau: Array = self.gains.position * now.e + self.gains.velocity * now.v_e
        return tau if self._weighed is None else tau + self._weighed.gravity(now.q)

    def given(self, now: Situation, asked: Array, given: Array) -> None:
        """Learn nothing."""

    def reset(self) -> None:
        """Forget nothing."""


class PidLaw:
    """Kp e + Kd v_e + Ki integral(e); a joint at its limit stops integrating away from it."""

    def __init__(self, gains: Gains, dt: float) -> None:
        """Create the law for a sampling time ``dt`` [s]."""
        self.gains, self._dt = gains, dt
        self._integral = np.zeros(gains.position.size)

    def torque(self, now: Situation) -> Array:
        """Return the torque that the law asks for, shape (nv,) [N m]."""
        tau: Array = self.gains.position * now.e + self.gains.velocity * now.v_e
        return tau + self._integral

    def given(self, now: Situation, asked: Array, given: Array) -> None:
        """Integrate the error where that does not ask for more than the limits give."""
        winds_up = (asked != given) & (np.sign(now.e) == np.sign(asked))
        self._integral = self._integral + np.where(
            winds_up, 0.0, self._dt * self.gains.integral * now.e
        )

    def reset(self) -> None:
        """Forget the integral."""
        self._integral = np.zeros(self.gains.position.size)


class ComputedTorqueLaw:
    """The inverse dynamics of a_target + k_p e + k_d v_e: every joint a double integrator."""

    def __init__(self, robot: Robot, dt: float, *, position: float, velocity: float) -> None:
        """Create the law.

        Args:
            robot: the robot whose model is inverted.
            dt: sampling time [s].
            position: gain of the error [1/s^2].
            velocity: gain of the velocity's error [1/s].
        """
        self._robot = robot.clone()
        self._change = dt * robot.damping * damping_share(robot, dt)
        self.position, self.velocity = position, velocity

    def torque(self, now: Situation) -> Array:
        """Return the torque that the law asks for, shape (nv,) [N m]."""
        wanted = now.a_target + self.position * now.e + self.velocity * now.v_e
        # damping acts on the speed of the coming sample, not on that of its beginning
        return self._robot.inverse_dynamics(now.q, now.v, wanted) + self._change * wanted

    def given(self, now: Situation, asked: Array, given: Array) -> None:
        """Learn nothing."""

    def reset(self) -> None:
        """Forget nothing."""


def pd(robot: Robot, dt: float = MpcSettings.dt, gains: Gains | None = None) -> BaselineController:
    """Return a PD controller; without gains it is tuned."""
    return BaselineController(robot, PdLaw(gains or tune_gains(robot, dt)), dt)


def pd_gravity(
    robot: Robot, dt: float = MpcSettings.dt, gains: Gains | None = None
) -> BaselineController:
    """Return a PD controller with gravity compensation; without gains it is tuned."""
    law = PdLaw(gains or tune_gains(robot, dt, carries_weight=True), robot.clone())
    return BaselineController(robot, law, dt)


def pid(robot: Robot, dt: float = MpcSettings.dt, gains: Gains | None = None) -> BaselineController:
    """Return a PID controller; without gains it is tuned."""
    law = PidLaw(gains or tune_gains(robot, dt, integrates=True), dt)
    return BaselineController(robot, law, dt)


def computed_torque(robot: Robot, dt: float = MpcSettings.dt) -> BaselineController:
    """Return a computed-torque controller with the gains of ``MpcController``'s default weights.

    They are the discrete LQR gains: while no limit is active and the model is right, MPC asks for
    the same accelerations.
    """
    settings = MpcSettings(dt=dt)
    weights = Weights(settings, 1)
    system = discretise(double_integrator(1), settings)
    A, B = system
    P = riccati(system, weights.Q, weights.R)
    gain = np.linalg.solve(weights.R + B.T @ P @ B, B.T @ P @ A)[0]  # u = -gain [e; v]
    law = ComputedTorqueLaw(robot, dt, position=-float(gain[0]), velocity=float(gain[1]))
    return BaselineController(robot, law, dt)

"""The model predictive controller: state and target in, a torque inside its limits out."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import isfinite, isnan
from operator import gt

import numpy as np

from arm3dof.control.bounds import TORQUE, Bounds
from arm3dof.control.fallback import Answer, Fallback
from arm3dof.control.formulation import Formulation
from arm3dof.control.observer import Observer
from arm3dof.control.optimum import Optimum
from arm3dof.control.paper import PaperFormulation
from arm3dof.control.plan import Plan
from arm3dof.control.program import Program
from arm3dof.control.qp import SOLVED
from arm3dof.control.reference import Reference, Target, sample_target
from arm3dof.control.settings import MpcSettings
from arm3dof.control.solver import ProgramSolver
from arm3dof.control.step import ControlStatus, ControlStep, PlannedStep, TorqueSource
from arm3dof.control.torque import TorqueFormulation
from arm3dof.control.tracking import TrackingFormulation
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState, frozen_array

_STICTION_SPEED = 1e-3  # [rad/s]: Coulomb friction is compensated in full from this speed on
_FRICTION_SHARE = 0.9  # friction compensation never takes more of the torque limit than this
_MOST_OVERSPEED = 10.0  # a speed of more than this many times its limit is a broken measurement
_MOST_OUTSIDE = 2 * np.pi  # [rad]: and so is a position this far outside its range
_TARGET_JUMP = 0.1  # [rad]: a target that moves more in one step makes the last plan useless
_ABSURD = 1e6  # [rad, rad/s, N m]: a limit this large is none
# members of enums that every step needs: looked up once, which takes as long as ten globals
_OPTIMUM, _OPTIMAL = TorqueSource.OPTIMUM, (ControlStatus.SOLVED, ControlStatus.SOFTENED)
_FARTHEST = 50.0  # [rad]: a target that is farther away pulls no harder
_FORMULATIONS: dict[str, Callable[[Robot, MpcSettings], Formulation]] = {
    "tracking": TrackingFormulation,
    "torque": TorqueFormulation,
    "paper": PaperFormulation,
}


class MpcController:
    """Solves the horizon once a step and applies the first torque of the optimum.

    Every ``ControlStep.tau`` is finite and inside the torque limits, whatever the state, the
    target and the solver did; ``status`` and ``source`` say what happened and what was done.

    Attributes:
        robot: the robot that is controlled.
        settings: the controller's settings.
        observer: what the controller has learned about disturbances.
    """

    def __init__(self, robot: Robot, settings: MpcSettings | None = None) -> None:
        self.robot = robot.clone()
        self.settings = settings or MpcSettings()
        wish = self.settings
        self.observer = Observer(self.robot, wish.dt, wish.gain, wish.delay, wish.measurement_noise)
        self._formulation: Formulation = _FORMULATIONS[wish.formulation](self.robot, wish)
        self._is_papers = wish.formulation == "paper"
        self._solver = ProgramSolver(wish.qp_settings)
        self._fallback = Fallback(self.robot, wish.dt, wish.plan_validity)
        tau_max = robot.limits.tau_max
        self._friction = np.minimum(robot.friction, _FRICTION_SHARE * tau_max)
        self._has_friction = bool(self._friction.any())
        scale = max(float(np.abs(self._formulation.weights.Q).max()), 1e-6)
        self._bounds = Bounds.of(
            robot.limits, tau_max - self._friction, wish.limit_weight * scale, wish.horizon
        )
        believable = (
            robot.limits.q_min - _MOST_OUTSIDE,
            robot.limits.q_max + _MOST_OUTSIDE,
            _MOST_OVERSPEED * robot.limits.v_max,
        )
        self._believable = np.stack(believable, axis=1).tolist()  # a row for each joint
        low, high, fastest = believable
        self._surely = min(-low.max(), high.min()), fastest.min()  # so far, and so fast, all are
        self._tau_max = tau_max.tolist()
        self._v_max = robot.limits.v_max.tolist()
        self._most_change = self._torque_change()
        # numbers without a sensible limit may overflow: then their program is not solved, and
        # nobody needs numpy's warning; where there is none to be silenced a step saves the time
        self._sensible = max(np.abs(believable).max(), tau_max.max()) < _ABSURD
        self._tau: Array | None = None
        self._target: list[float] | None = None
        self._held: Reference | None = None  # the last reference, ...
        self._settled: list[float] | None = None  # ... and its target, if that is constant and near

    @property
    def dt(self) -> float:
        """Time between two steps [s]."""
        return self.settings.dt

    def reset(self) -> None:
        """Forget the past: the next step is as if it were the first."""
        self._forget_plan()
        self._fallback.reset()
        self.observer.reset()
        self._tau = self._target = self._held = self._settled = None

    def step(self, state: JointState, target: Target) -> ControlStep:
        """Return the torque to apply until the next step.

        Args:
            state: measured state. One that no arm can be in (NaN, infinity, ten times the speed
                limit, a turn outside the joint range) is answered with ``BAD_MEASUREMENT``.
            target: constant target, shape (nv,) [rad], or a trajectory; NaN or infinity is
                answered with ``BAD_TARGET``.

        Raises:
            InputError: the state or the target belongs to a robot with another number of joints.
        """
        start = time.perf_counter()
        self._check_size(state)
        reference = self._reference(state, target)
        if not self._is_plausible(state):
            self.observer.lose()
            return self._fall_back(None, reference, ControlStatus.BAD_MEASUREMENT, start)
        if self.observer.measure(state):
            self._formulation.reset()  # the masses that its torque rows hold are out of date
        state = self.observer.predict(state.t)
        lost = self.observer.lost
        if reference is not self._held:
            if not _is_finite(reference.q):
                return self._fall_back(state, reference, ControlStatus.BAD_TARGET, start)
            reference = self._within_reach(reference, state)
            lost |= self._target_jumped(reference)
            self._hold(reference)
        if lost:
            self._forget_plan()
        limit = self.settings.max_step_time
        deadline = None if limit is None else start + limit
        self._solver.begin(deadline)
        if self._sensible:
            optimum, plan = self._optimise(state, reference)
        else:
            with np.errstate(all="ignore"):
                optimum, plan = self._optimise(state, reference)
        if deadline is not None and time.perf_counter() > deadline:
            return self._fall_back(state, reference, ControlStatus.DEADLINE_MISSED, start)
        if optimum is None or plan is None or optimum.status is not SOLVED:
            return self._fall_back(state, reference, ControlStatus.NOT_SOLVED, start)
        self._fallback.remember(plan)
        self._solver.advance(self.settings.horizon, len(self._tau_max))
        rigid = self._within_rate(optimum)
        tau = rigid
        if self._has_friction:
            tau = rigid + self._friction_compensation(plan.states[1, 0])
        acceleration = plan.u[0]
        # the paper's u leaves the Coriolis torque out; otherwise u is the acceleration
        u = optimum.w[: tau.size] if self._is_papers else acceleration
        answer = Answer(tau, rigid, u, acceleration, plan, _OPTIMUM)
        return self._finish(answer, reference, _OPTIMAL[optimum.softened], start)

    def observe(self, state: JointState) -> None:
        """Take note of what was measured between two steps, at the rate of the encoders.

        It costs next to nothing and is not needed; under noise many readings tell more than one.
        They have to be evenly spaced, with ``step``'s measurement the last of them.

        Args:
            state: measured state.

        Raises:
            InputError: the state belongs to a robot with another number of joints.
        """
        self._check_size(state)
        self.observer.filter.observe(state)

    def optimise(self, state: JointState, target: Target) -> Optimum:
        """Return the optimum of one step from scratch, for study; the controller is unchanged.

        Args:
            state: state, finite.
            target: what to follow, finite.

        Raises:
            InputError: the state or the target is not finite.
        """
        fresh = MpcController(self.robot, self.settings)
        reference = fresh._reference(state, target)
        optimum = fresh._optimise(state, reference)[0] if state.is_finite else None
        if optimum is None:
            raise InputError(f"no program follows from q = {state.q}, v = {state.v}")
        return optimum

    def _check_size(self, state: JointState) -> None:
        if state.q.size != len(self._tau_max):
            raise InputError(
                f"the state has {state.q.size} joints; {self.robot.name} has {self.robot.nv}"
            )

    def _forget_plan(self) -> None:
        self._formulation.reset()
        self._solver.reset()
        self._fallback.expire()

    def _within_reach(self, reference: Reference, state: JointState) -> Reference:
        """Return the reference, with absurdly far targets moved nearer: they take long to solve."""
        if np.abs(reference.q).max() < _FARTHEST:
            return reference
        low, high = state.q - _FARTHEST, state.q + _FARTHEST
        return Reference(np.clip(reference.q, low, high), reference.v)

    def _target_jumped(self, reference: Reference) -> bool:
        last, self._target = self._target, reference.q[0].tolist()
        if last is None:
            return True
        moves = zip(last, self._target, strict=True)
        return any(abs(after - before) > _TARGET_JUMP for before, after in moves)

    def _hold(self, reference: Reference) -> None:
        """Note a constant target that is near: it need not be looked at again while it stays."""
        near = len(reference.q) == 1 and np.abs(reference.q).max() < _FARTHEST
        self._held, self._settled = reference, self._target if near else None

    def _reference(self, state: JointState, target: Target) -> Reference:
        if self._held and isinstance(target, np.ndarray) and target.tolist() == self._settled:
            return self._held
        begin = state.t + self.settings.delay
        return sample_target(target, self.robot.nv, begin, self.dt, self.settings.horizon)

    def _optimise(
        self, state: JointState, reference: Reference
    ) -> tuple[Optimum | None, Plan | None]:
        """Linearise along the last plan and solve; without a plan, repeat along the new one."""
        formulation, horizon, bounds = self._formulation, self.settings.horizon, self._bounds
        if any(map(gt, map(abs, state.v.tolist()), self._v_max)):
            bounds = bounds.slowing_from(state.v)
        if self._most_change is not None:
            tau_max = self.robot.limits.tau_max
            held = np.clip(self.robot.gravity(state.q), -tau_max, tau_max)
            bounds = bounds.with_rate(self._most_change, held if self._tau is None else self._tau)
        u = self._fallback.shifted(horizon)
        rounds = 1
        if u is None:
            rounds = formulation.linearisations
            self._solver.reset()
        plan: Plan | None = None
        optimum: Optimum | None = None
        for _ in range(rounds):
            if plan is not None:
                u = plan.u[:horizon]
            try:
                program = formulation.build(state, reference, u, self.observer.disturbance)
            except np.linalg.LinAlgError:
                return None, None
            optimum = self._solver.solve(program, bounds)
            if optimum.status is not SOLVED:
                break
            plan = self._plan(state, program, optimum)
        return optimum, plan

    def _plan(self, state: JointState, program: Program, optimum: Optimum) -> Plan:
        decided, states = program.accelerations(optimum.w), optimum.states
        if decided is None:
            decided = np.diff(states[1], axis=0, prepend=state.v[np.newaxis]) / self.dt
            decided = np.concatenate((decided, decided[-1:]))
        return Plan(decided, (state.q, state.v), states)

    def _is_plausible(self, state: JointState) -> bool:
        positions, speeds = state.q.tolist(), state.v.tolist()
        if sum(map(abs, positions)) <= self._surely[0] and sum(map(abs, speeds)) <= self._surely[1]:
            return True  # the usual case, which NaN is not
        joints = zip(positions, speeds, self._believable, strict=True)
        return all(low <= q <= high and abs(v) <= fastest for q, v, (low, high, fastest) in joints)

    def _within_rate(self, optimum: Optimum) -> Array:
        """Return the torque of stage 0; a limit of its change holds to the last digit."""
        if self._most_change is None:
            tau: Array = optimum.values[TORQUE, 0]
            return tau
        last = optimum.bounds.last_torque
        change = np.minimum(
            np.maximum(optimum.tau[0] - last, -self._most_change), self._most_change
        )
        return np.asarray(last + change)

    def _torque_change(self) -> Array | None:
        """Return the largest change of torque in a step, shape (nv,) [N m]."""
        rate = self.settings.torque_rate
        if rate is None:
            return None
        nv = self.robot.nv
        change = frozen_array(np.broadcast_to(rate, nv) * self.dt, nv, name="torque_rate")
        if not (np.isfinite(change).all() and (change > 0).all()):
            raise InputError(f"torque_rate is {rate!r}; give positive numbers of N m/s")
        return change

    def _limited(self, tau: Array) -> Array:
        wished = zip(tau.tolist(), self._tau_max, strict=True)
        return np.array([0.0 if isnan(t) else min(max(t, -most), most) for t, most in wished])

    def _friction_compensation(self, v_next: Array) -> Array:
        return self._friction * np.minimum(np.maximum(v_next / _STICTION_SPEED, -1.0), 1.0)

    def _fall_back(
        self, state: JointState | None, reference: Reference, status: ControlStatus, start: float
    ) -> ControlStep:
        answer = self._fallback.answer(state, self.observer.disturbance)
        return self._finish(answer, reference, status, start)

    def _finish(
        self, answer: Answer, reference: Reference, status: ControlStatus, start: float
    ) -> ControlStep:
        tau = answer.tau
        for torque, most in zip(tau.tolist(), self._tau_max):
            if not -most <= torque <= most:
                tau = self._limited(tau)
                break
        if answer.tau is answer.rigid:
            self.observer.command(answer.acceleration, tau)
        else:
            self.observer.command(answer.acceleration, tau - (answer.tau - answer.rigid))
        self._tau = tau
        spent = time.perf_counter() - start
        return PlannedStep.adopt(
            tau, answer.u, reference.q, answer.plan, status, answer.source, spent
        )


def _is_finite(values: Array) -> bool:
    """Whether all numbers are finite; faster than numpy for the one row of a constant target."""
    return all(map(isfinite, values[0].tolist())) and (
        len(values) == 1 or bool(np.isfinite(values).all())
    )

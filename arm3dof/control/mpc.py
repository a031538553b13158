"""The model predictive controller: state and target in, a torque inside its limits out."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.fallback import Answer, Fallback
from arm3dof.control.paper import PaperFormulation
from arm3dof.control.program import Optimum, Program, ProgramSolver
from arm3dof.control.qp import QpStatus
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState, frozen_array

_STICTION_SPEED = 1e-3  # [rad/s]: Coulomb friction is compensated in full from this speed on
_MOST_OVERSPEED = 10.0  # a speed of more than this many times its limit is a broken measurement
_MOST_OUTSIDE = 2 * np.pi  # [rad]: and so is a position this far outside its range
_FRICTION_SHARE = 0.9  # friction compensation never takes more of the torque limit than this


class MpcController:
    """Solves the horizon once a step and applies the first torque of the optimum.

    Every ``ControlStep.tau`` is finite and inside the torque limits, whatever the state, the
    target and the solver did; ``status`` and ``source`` say what happened and what was done.

    Attributes:
        robot: the robot that is controlled.
        settings: the controller's settings.
    """

    def __init__(self, robot: Robot, settings: MpcSettings | None = None) -> None:
        self.robot = robot.clone()
        self.settings = settings or MpcSettings()
        self._formulation = PaperFormulation(self.robot, self.settings)
        scale = max(float(np.abs(self._formulation.Q).max()), 1e-6)
        self._solver = ProgramSolver(
            robot.limits, self.settings.limit_weight * scale, self.settings.qp_settings
        )
        self._fallback = Fallback(self.robot, self.settings.dt, self.settings.plan_validity)
        self._friction = np.minimum(robot.friction, _FRICTION_SHARE * robot.limits.tau_max)

    @property
    def dt(self) -> float:
        """Time between two steps [s]."""
        return self.settings.dt

    def reset(self) -> None:
        """Forget the past: the next step is as if it were the first."""
        self._solver.reset()
        self._fallback.reset()

    def step(self, state: JointState, q_target: ArrayLike) -> ControlStep:
        """Return the torque to apply until the next step.

        Args:
            state: measured state. One that no arm can be in (NaN, infinity, ten times the speed
                limit, a turn outside the joint range) is answered with ``BAD_MEASUREMENT``.
            q_target: target, shape (nv,) [rad]; NaN or infinity is answered with ``BAD_TARGET``.

        Raises:
            InputError: the state or the target belongs to a robot with another number of joints.
        """
        start = time.perf_counter()
        q_target = frozen_array(q_target, self.robot.nv, name="q_target")
        if state.q.size != self.robot.nv:
            raise InputError(
                f"the state has {state.q.size} joints; {self.robot.name} has {self.robot.nv}"
            )
        if not self._is_plausible(state):
            return self._fall_back(None, ControlStatus.BAD_MEASUREMENT, start)
        if not np.isfinite(q_target).all():
            return self._fall_back(state, ControlStatus.BAD_TARGET, start)
        with np.errstate(all="ignore"):  # an absurd state overflows; its program is not solved
            program = self._formulation.build(state, q_target)
            optimum = self._solve(program, q_target)
        if optimum.solution.status is not QpStatus.SOLVED:
            return self._fall_back(state, ControlStatus.NOT_SOLVED, start)
        limit = self.settings.max_step_time
        if limit is not None and time.perf_counter() - start > limit:
            return self._fall_back(state, ControlStatus.DEADLINE_MISSED, start)
        self._fallback.remember(optimum, q_target)
        u = optimum.u[0]
        rigid = program.torque_gain[0] @ u + program.torque_offset[0]
        tau = rigid + self._friction_compensation(state.v + self.dt * u)
        answer = Answer(tau, u, optimum.x, TorqueSource.OPTIMUM)
        status = ControlStatus.SOFTENED if optimum.softened else ControlStatus.SOLVED
        return self._finish(answer, status, start)

    def optimise(self, state: JointState, q_target: ArrayLike) -> Optimum:
        """Return the optimum of one step with its QP, for study; the controller is unchanged.

        Args:
            state: state, finite.
            q_target: target, shape (nv,) [rad], finite.
        """
        target = frozen_array(q_target, self.robot.nv, name="q_target")
        return self._solve(self._formulation.build(state, target), target)

    def _solve(self, program: Program, q_target: Array) -> Optimum:
        return self._solver.solve(program, q_target, self.robot.limits.tau_max - self._friction)

    def _is_plausible(self, state: JointState) -> bool:
        limits = self.robot.limits
        low, high = limits.q_min - _MOST_OUTSIDE, limits.q_max + _MOST_OUTSIDE
        in_range = (state.q >= low) & (state.q <= high)
        return bool((in_range & (np.abs(state.v) <= _MOST_OVERSPEED * limits.v_max)).all())

    def _friction_compensation(self, v_next: Array) -> Array:
        return self._friction * np.clip(v_next / _STICTION_SPEED, -1.0, 1.0)

    def _fall_back(
        self, state: JointState | None, status: ControlStatus, start: float
    ) -> ControlStep:
        return self._finish(self._fallback.answer(state), status, start)

    def _finish(self, answer: Answer, status: ControlStatus, start: float) -> ControlStep:
        tau_max = self.robot.limits.tau_max
        tau = np.clip(np.nan_to_num(answer.tau, posinf=np.inf, neginf=-np.inf), -tau_max, tau_max)
        for array in (tau, answer.u, answer.plan):
            array.flags.writeable = False
        elapsed = time.perf_counter() - start
        return ControlStep(tau, answer.u, answer.plan, status, answer.source, elapsed)

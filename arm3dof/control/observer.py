"""What the controller learns from how the arm answered: state, load, disturbance, what is coming.

A command holds a torque for one sample, and was meant to give a known acceleration. What the arm
did instead, as far as it is no noise (``estimator``), shows what the model misses (``load``), and
what is left of that is a disturbance torque. The intended accelerations also tell where the arm
will be when a command that is computed now begins to act.
"""

from __future__ import annotations

from collections import deque
from operator import add, gt

import numpy as np

from arm3dof.control.estimator import Sample, StateEstimator
from arm3dof.control.load import LoadEstimator
from arm3dof.model.robot import Robot
from arm3dof.state import Array, JointState

_JUMP = 0.05  # [rad]: a position this far from where the velocities lead has jumped
_JUMP_NOISE = 6.0  # and so many standard deviations of its noise farther

_STOP = 1e-3  # [rad]: a joint this near the end of its range may lean on its stop
_GIVEN_UP = 0.7  # share of a disturbance that is left after a step in which a stop's joint stayed
_STAYED = 0.05  # torque that is missing for leaving, as a share of the disturbance to be given up

_MOST_UNEXPLAINED = 3.0  # torque that may come from outside, in multiples of the joint's own


class Observer:
    """Estimates state, load and disturbance, and predicts the state over the declared delay.

    Attributes:
        disturbance: estimated torque that acts beside the commanded one, shape (nv,) [N m].
        estimator: what is known about the load.
        filter: what is known about state and noise.
        jumped: whether the last measured position does not follow from the one before it and the
            velocities; such a step teaches nothing about torques.
        lost: whether a joint jumped farther than it was moving anyway, or nobody knows how far; a
            plan that was made before is of no use. A fast arm may well have been faster in between.
    """

    def __init__(
        self, robot: Robot, dt: float, gain: float, delay: float, noise: float | None = 0.0
    ) -> None:
        """Create an observer that has seen nothing.

        Args:
            robot: the controller's own robot; it is taught what is learned about the load.
            dt: time between steps [s].
            gain: share of an unexplained torque that is learned in each step, 0 to 1; 0 learns
                nothing at all. Under noise less is learned.
            delay: time from a measurement to when the torque computed from it acts [s].
            noise: standard deviation of measured positions [rad]; ``None`` to learn it, 0 to
                believe every measurement.
        """
        self._robot, self._dt, self._gain = robot, dt, gain
        limits = robot.limits
        self._tau_max = limits.tau_max.tolist()
        self._range = list(zip(limits.q_min.tolist(), limits.q_max.tolist(), strict=True))
        self._absurd = (_MOST_UNEXPLAINED * limits.tau_max).tolist()
        self._whole = int(delay / dt + 1e-9)
        self._part = max(delay - self._whole * dt, 0.0)
        self.estimator = LoadEstimator(robot, dt)
        self.filter = StateEstimator(robot.nv, dt, gain, noise)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        nothing = np.zeros(self._robot.nv)
        self.disturbance = nothing
        self.estimator.reset()
        self.estimator.teach()
        self.filter.reset()
        # acceleration and torque of the commands that act or are on their way, oldest first
        length = self._whole + 2
        self._commands = deque([(nothing, nothing)] * length, maxlen=length)
        self._known = 0  # how many of them were given
        self._last: JointState | None = None
        self.jumped = self.lost = True

    def measure(self, state: JointState) -> bool:
        """Learn from a measured state that can be believed.

        Returns:
            Whether the robot was taught other masses.
        """
        last, self._last = self._last, state
        self.jumped = self.lost = True
        if last is not None:
            half = self._dt / 2
            v, v_now = last.v.tolist(), state.v.tolist()
            moves = zip(last.q.tolist(), v, state.q.tolist(), v_now)
            gap = [q1 - q0 - half * (v0 + v1) for q0, v0, q1, v1 in moves]
            self.jumped = self.lost = max(map(abs, gap)) > _JUMP
            if self.jumped:
                joints = zip(gap, self.filter.noise, v, v_now, strict=True)
                beyond = [
                    abs(far) - _JUMP - _JUMP_NOISE * noise - half * abs(v1 - v0)
                    for far, noise, v0, v1 in joints
                ]
                moved = [self._dt * min(abs(v0), abs(v1)) for v0, v1 in zip(v, v_now, strict=True)]
                self.jumped, self.lost = max(beyond) > 0.0, any(map(gt, beyond, moved))
        if self.jumped or self._known < len(self._commands):
            self.filter.restart(state)  # what acted before the first command is not known
            return False
        u, torque = self._commands[1]
        if self._part > 0:  # the command before it acted for the first part of the sample
            share, before = self._part / self._dt, self._commands[0]
            u, torque = u + share * (before[0] - u), torque + share * (before[1] - torque)
        sample = self.filter.update(u, gap, state)
        return self._gain > 0 and self._learn(sample, u, torque)

    def lose(self) -> None:
        """Note that this step's measurement cannot be believed."""
        self._last = None
        self.jumped = self.lost = True
        self.filter.drop_readings()

    def predict(self, t: float) -> JointState:
        """Return the state when a command computed now begins to act.

        Args:
            t: time of the last measurement [s].
        """
        q, v = self.filter.q, self.filter.v
        if self._whole == 0 and self._part == 0.0:
            last = self._last
            if last is not None and q is last.q and v is last.v:
                return last
            return JointState.adopt(t, q, v)
        spans = [self._part] + [self._dt] * self._whole
        for span, (u, _) in zip(spans, list(self._commands)[1:]):
            t, q, v = t + span, q + span * v + span**2 / 2 * u, v + span * u
        return JointState.adopt(t, q, v)

    def command(self, acceleration: Array, torque: Array) -> None:
        """Note this step's command.

        Args:
            acceleration: what it is meant to give, shape (nv,) [rad/s^2].
            torque: its torque without friction compensation, shape (nv,) [N m].
        """
        self._commands.append((acceleration, torque))
        self._known += 1

    def _learn(self, sample: Sample, u: Array, torque: Array) -> bool:
        q, v, lasting = sample
        per_gain = 1.0 / self._gain
        meant = zip(u.tolist(), lasting)
        acceleration = [expected + per_gain * more for expected, more in meant]
        known = self.disturbance
        unexplained, surprise = self.estimator.look(q, v, acceleration, torque, known)
        if any(map(gt, map(abs, unexplained), self._absurd)):
            self.jumped = self.lost = True  # no load or push does this: it does not belong together
            return False
        changes = None
        if not self._leans(q, acceleration, surprise):
            self.estimator.learn()
            changes = self.estimator.teach()
        gain, learned = self._gain, self.disturbance.tolist()
        if changes:  # what is explained from now on is no longer a disturbance, and the reverse
            learned = list(map(add, learned, changes))
        joints = zip(learned, surprise, self._tau_max)
        learned = [
            new if -most <= (new := d - gain * more) <= most else min(max(new, -most), most)
            for d, more, most in joints
        ]
        self.disturbance = np.array(learned)
        return changes is not None

    def _leans(self, q: list[float], acceleration: list[float], surprise: list[float]) -> bool:
        """Whether a joint leans on its end stop; if so, forget what the stop does to it.

        A stop holds against whatever torque there is. Taken for a disturbance, it would be pushed
        against ever harder. And a disturbance that was learned on the way there, and is unlearned
        too slowly where nothing moves, is given up while the joint should leave and stays.
        """
        near = _STOP + self.filter.most_noise
        for at, (low, high) in zip(q, self._range):
            if not low + near < at < high - near:
                break
        else:
            return False  # the usual case, said shortly
        leans = False
        disturbance = self.disturbance.tolist()
        for joint, (at, (low, high)) in enumerate(zip(q, self._range, strict=True)):
            end = (at >= high - near) - (at <= low + near)
            missing = -end * surprise[joint]  # torque on the way away from the stop
            pressing = -end * disturbance[joint]  # what cancelling the disturbance presses with
            if end * acceleration[joint] < 0 and pressing > 0 and missing > _STAYED * pressing:
                disturbance[joint] *= _GIVEN_UP
            if missing < 0:
                surprise[joint], leans = 0.0, True
        self.disturbance = np.array(disturbance)
        return leans

"""A plant to which things happen that a model does not know: pushes, loads, delay and noise."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.sim.encoder import EncoderNoise
from arm3dof.sim.events import (
    JointTorque,
    PayloadChange,
    Push,
    Wrench,
    joint_axis,
    share_of_step,
)
from arm3dof.sim.plant import DisturbablePlant, PlantAround
from arm3dof.state import Array, JointState, finite_vector

__all__ = ["DisturbedPlant", "JointTorque", "PayloadChange", "Push", "Wrench"]


class DisturbedPlant(PlantAround[DisturbablePlant]):
    """A plant to which things happen that its controller is not told.

    Times are the plant's. Pushes and payloads come at the plant step nearest to their time, and
    are seen in the state of that instant; what lies before the state of a ``reset`` is over, but a
    payload taken up by then is carried. A wrench acts on its exact times: in a step that it does
    not fill its mean acts, so that its impulse is right.

    Commands act ``delay`` later. Until the first one arrives the motors hold the arm against
    gravity at the pose of the last ``reset``, as far as their limits let them. ``applied_torque``
    is what the motors give, so with a delay it is the command of some time ago.

    Attributes:
        plant: the plant inside.
    """

    def __init__(
        self,
        plant: DisturbablePlant,
        *,
        payloads: Sequence[PayloadChange] = (),
        pushes: Sequence[Push] = (),
        wrenches: Sequence[Wrench | JointTorque] = (),
        delay: float = 0.0,
        noise: ArrayLike = 0.0,
        velocity_filter: float = 0.01,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Surround a plant, which is to be moved through this object alone from now on.

        Args:
            plant: the plant; its robot is the true one, its present state the start.
            payloads: changes of the payload at the tool.
            pushes: displacements of joints.
            wrenches: forces and moments on the tool, and moments on joints.
            delay: time from command to torque [s], rounded to whole plant steps.
            noise: standard deviation of measured positions, one number or one a joint [rad]; the
                velocities' noise follows from it, see ``EncoderNoise``.
            velocity_filter: time constant of the filters behind the differentiated position [s].
            rng: source of the noise; needed where there is noise.

        Raises:
            InputError: a number is outside its domain, or there is noise without ``rng``.
            FrameNotFound: the robot has no such joint.
        """
        super().__init__(plant)
        self._original = robot = plant.robot
        in_time = sorted(payloads, key=lambda change: change.t)
        self._loads = [(change.t, change.on(robot)) for change in in_time]
        self._pushes = [(push.t, push.angle * joint_axis(robot, push.joint)) for push in pushes]
        self._tool_wrenches: list[tuple[Wrench | JointTorque, Array]] = []
        self._joint_torques: list[tuple[Wrench | JointTorque, Array]] = []
        for event in wrenches:
            if isinstance(event, Wrench):
                self._tool_wrenches.append((event, np.concatenate([event.force, event.torque])))
            else:
                torque = event.torque * joint_axis(robot, event.joint)
                self._joint_torques.append((event, torque))
        if not (np.isfinite(delay) and delay >= 0):
            raise InputError(f"delay is {delay!r}; give 0 or more seconds")
        self._delay_steps = round(delay / plant.dt)
        self._noise = _encoder_noise(robot, noise, plant.dt, velocity_filter, rng)
        self._begin()

    def reset(self, state: JointState) -> JointState:
        """Place the arm in a state, let everything happen anew, and return the state.

        The noise goes on from where its generator is.

        Raises:
            InputError: the state is not finite or belongs to another robot.
        """
        self.plant.reset(state)
        if self._noise is not None:
            self._noise.restart()
        return self._begin()

    def step(self, tau: ArrayLike) -> JointState:
        """Command a torque for ``dt`` and return the true state after it.

        Args:
            tau: torque, shape (nv,) [N m]; it acts when the delay is over.

        Raises:
            InputError: the torque has another shape or is not finite.
        """
        self._commands.append(finite_vector(tau, self.robot.nv, "tau"))
        arrived = len(self._commands) > self._delay_steps
        self.plant.step(
            self._commands.popleft() if arrived else self._holding,
            external_torque=self._acting(self._joint_torques),
            tool_wrench=self._acting(self._tool_wrenches),
        )
        if self._noise is not None:
            self._noise.advance()
        self._steps += 1
        if self._steps in self._load_at:
            self.plant.change_robot(self._load_at[self._steps])
        if self._steps in self._push_at:
            self.plant.displace(self._push_at[self._steps])
        return self.state

    def measure(self) -> JointState:
        """Return the present state as the encoders tell it; asked twice, the same."""
        state = self.state
        if self._noise is None:
            return state
        return JointState.adopt(state.t, state.q + self._noise.q, state.v + self._noise.v)

    def _acting(self, events: list[tuple[Wrench | JointTorque, Array]]) -> Array | None:
        """Return the mean over the next step of all that acts in it; ``None`` for nothing."""
        if not events:
            return None
        t, dt = self.state.t, self.dt
        acting = [
            share * vector for event, vector in events if (share := share_of_step(event, t, dt))
        ]
        return np.sum(acting, axis=0) if acting else None

    def _begin(self) -> JointState:
        """Plan what will happen from the present state on, and let the first of it happen."""
        self._steps, start = 0, self.state
        loads = [(round((t - start.t) / self.dt), robot) for t, robot in self._loads]
        self._load_at = {step: robot for step, robot in loads if step > 0}
        carried = [robot for step, robot in loads if step <= 0]
        self.plant.change_robot(carried[-1] if carried else self._original)
        limit = self.robot.limits.tau_max
        self._holding = np.clip(self.robot.gravity(start.q), -limit, limit)
        self._commands: deque[Array] = deque()
        self._push_at: dict[int, Array] = {}
        for t, change in self._pushes:
            step = round((t - start.t) / self.dt)
            self._push_at[step] = self._push_at.get(step, 0.0) + change
        if 0 in self._push_at:
            self.plant.displace(self._push_at[0])
        return self.state


def _encoder_noise(
    robot: Robot,
    noise: ArrayLike,
    dt: float,
    velocity_filter: float,
    rng: np.random.Generator | None,
) -> EncoderNoise | None:
    each = noise if np.ndim(noise) else np.full(robot.nv, noise)
    sigma = finite_vector(each, robot.nv, "noise")
    if not sigma.any():
        return None
    if rng is None:
        raise InputError("noise needs a source: give rng=numpy.random.default_rng(seed)")
    return EncoderNoise(sigma, dt, velocity_filter, rng)

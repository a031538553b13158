"""What a servo does to a torque command, and what its encoder says: the model of both plants.

A command passes through, in this order,

1. a delay of whole plant steps;
2. the torque-speed line of a DC motor on a supply: with the stall torque T and the no-load speed w
   the motor gives at speed v at most T min(1, 1 - v / w) forwards, and likewise backwards; both T
   and w scale with the supply voltage;
3. the gears' backlash: a motor of small reflected inertia J that may run ahead of or behind the
   joint by half the play. On a flank the motor's torque goes through to the joint as long as it
   presses on that flank; in between the joint gets nothing while the motor crosses the play, and
   where it arrives its momentum passes to the joint without rebound. A motor on its flank moves
   with the joint and is weightless, as in a URDF.

Coulomb and viscous friction act at the joint. They are left to the plant, which adds
``friction`` and ``damping`` to its robot's and solves for them implicitly: friction that a
controller-side sign function stands for would chatter.

The encoder tells whole steps of its resolution, on the joint (a hobby servo's potentiometer sits
on the output shaft) or on the motor's side of the play, with noise if wished. Velocities are what
a drive makes of such positions, see ``EncoderError``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.model.servos import Servos, servo_data
from arm3dof.sim.encoder import EncoderError
from arm3dof.state import Array, JointState, finite_vector, frozen_array

Side = Literal["joint", "motor"]
"""Where an encoder sits: behind the backlash, or before it."""


@dataclass(frozen=True, eq=False)
class Servo:
    """The servos of an arm; each attribute is one number for all joints, or one a joint.

    Attributes:
        stall_torque: torque at standstill and rated voltage [N m].
        no_load_speed: speed without load at rated voltage [rad/s].
        supply: voltage as a share of the rated one.
        friction: Coulomb friction at the joint, beyond the robot's own [N m].
        damping: viscous friction at the joint, beyond the robot's own [N m s/rad].
        backlash: the gears' whole play [rad].
        rotor_inertia: the motor's inertia at the joint [kg m^2]; it matters in the play alone.
        resolution: step of the encoder [rad]; 0 for a continuous one.
        noise: standard deviation of measured positions [rad].
        velocity_filter: time constant of the filters behind the differentiated position [s].
        encoder: the side of the play that the encoder sits on.
        delay: time from command to torque [s].

    Raises:
        InputError: a number is outside its domain.
    """

    stall_torque: ArrayLike
    no_load_speed: ArrayLike
    supply: float = 1.0
    friction: ArrayLike = 0.0
    damping: ArrayLike = 0.0
    backlash: ArrayLike = 0.0
    rotor_inertia: ArrayLike = 1e-3
    resolution: ArrayLike = 0.0
    noise: ArrayLike = 0.0
    velocity_filter: float = 0.01
    encoder: Side = "joint"
    delay: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name == "encoder":
                continue
            value = np.array(getattr(self, field.name), dtype=np.float64)
            above = field.name in _POSITIVE
            if not (np.isfinite(value).all() and ((value > 0) if above else (value >= 0)).all()):
                wanted = "finite numbers above 0" if above else "finite numbers of 0 or more"
                raise InputError(f"the servo's {field.name} is {value.tolist()}; give {wanted}")
        if self.encoder not in get_args(Side):
            raise InputError(f"the servo's encoder is {self.encoder!r}; give 'joint' or 'motor'")

    @staticmethod
    def named(
        servos: Servos, robot: Robot, *, voltage: float | None = None, **faults: Any
    ) -> Servo:
        """Return servos of the catalogue, with the resolution that their data sheets state.

        Args:
            servos: one servo for all joints, or servos by joint; a joint without one has its
                robot's own limits and a continuous encoder.
            robot: the robot that they drive.
            voltage: supply [V]; each servo's rated voltage when ``None``.
            faults: further attributes, such as ``friction``, ``backlash`` and ``delay``.

        Raises:
            InputError: a servo is unknown, or a number is outside its domain.
        """
        chosen = servos if isinstance(servos, Mapping) else dict.fromkeys(robot.joint_names, servos)
        torque, speed = np.array(robot.limits.tau_max), np.array(robot.limits.v_max)
        resolution = np.zeros(robot.nv)
        for index, joint in enumerate(robot.joint_names):
            if joint in chosen:
                data = servo_data(chosen[joint])
                data = data if voltage is None else data.at_voltage(voltage)
                torque[index], speed[index] = data.stall_torque, data.no_load_speed
                resolution[index] = data.resolution
        return replace(Servo(torque, speed, resolution=resolution), **faults)

    def drive(self, robot: Robot, dt: float, rng: np.random.Generator | None = None) -> ServoDrive:
        """Return the moving part for an arm that is stepped every ``dt`` [s].

        Raises:
            InputError: an attribute has another number of joints, or there is noise without
                ``rng``.
        """
        return ServoDrive(self, robot, dt, rng)

    def each(self, name: str, nv: int) -> Array:
        """Return an attribute, one number a joint, shape (nv,).

        Raises:
            InputError: it has another number of joints.
        """
        value = np.asarray(getattr(self, name), dtype=np.float64)
        return frozen_array(np.full(nv, value) if value.ndim == 0 else value, nv, name=name)


_SAMPLED_POSES = 32
_POSITIVE = ("stall_torque", "no_load_speed", "supply", "rotor_inertia", "velocity_filter")


class ServoDrive:
    """Servos at work, from command to joint torque and from joint state to measurement.

    Attributes:
        friction: Coulomb friction that the plant is to add, shape (nv,) [N m].
        damping: viscous friction that the plant is to add, shape (nv,) [N m s/rad].
        play: how far the motors are ahead of the joints, shape (nv,) [rad].
    """

    def __init__(
        self, servo: Servo, robot: Robot, dt: float, rng: np.random.Generator | None = None
    ) -> None:
        """Set servos up; ``reset`` places them. See ``Servo.drive``."""
        nv = robot.nv
        self.friction, self.damping = servo.each("friction", nv), servo.each("damping", nv)
        self._stall = servo.supply * servo.each("stall_torque", nv)
        self._speed = servo.supply * servo.each("no_load_speed", nv)
        self._half = servo.each("backlash", nv) / 2
        self._inertia = servo.each("rotor_inertia", nv)
        self._has_play = bool(self._half.any())
        self._dt, self._late = dt, round(servo.delay / dt)
        self._on_motor = servo.encoder == "motor"
        self._encoder = EncoderError(
            servo.each("resolution", nv), servo.each("noise", nv), dt, servo.velocity_filter, rng
        )
        stiffness = dt * self._stall / (self._speed * _least_inertia(robot))
        self._follow = 1 / (1 + stiffness)
        self._nv = nv
        self.play = np.zeros(nv)
        zero = JointState(0.0, self.play, self.play)
        self.reset(zero, np.zeros(nv))

    def reset(self, state: JointState, holding: ArrayLike) -> None:
        """Begin at a state.

        Args:
            state: where the joints are.
            holding: torque that acts until the first command arrives, shape (nv,) [N m]; the
                gears lie on the flank that it presses on.
        """
        self._holding = finite_vector(holding, self._nv, "holding")
        self._commands: deque[Array] = deque()
        self.play = np.sign(self._holding) * self._half
        self._rotor = np.array(state.v)
        self._low, self._high = self.limits(state.v)
        self._blow = np.zeros(self._nv)
        self._read: JointState | None = None
        self._encoder.restart(self._shown(state))

    def limits(self, v: ArrayLike) -> tuple[Array, Array]:
        """Return the least and the largest torque that the motors give at a speed, each (nv,)."""
        share = np.asarray(v, dtype=np.float64) / self._speed
        low = -self._stall * np.clip(1 + share, -1, 1)
        return low, self._stall * np.clip(1 - share, -1, 1)

    def torque(self, command: ArrayLike, v: ArrayLike) -> Array:
        """Return what reaches the joints in the next step; called once a plant step.

        Args:
            command: torque asked for, shape (nv,) [N m].
            v: joint velocities, shape (nv,) [rad/s].
        """
        self._commands.append(finite_vector(command, self._nv, "command"))
        arrived = len(self._commands) > self._late
        wanted = self._commands.popleft() if arrived else self._holding
        speed = np.asarray(v, dtype=np.float64)
        if not self._has_play:
            return self._bounded(wanted, speed)
        return self._through_the_play(wanted, speed)

    def measure(self, state: JointState) -> JointState:
        """Return what the encoders say of a state; asked twice for one instant, the same.

        A plant asks once a step, so that the drive can differentiate.
        """
        if self._read is None or self._read.t != state.t:
            q, v = self._encoder.read(self._shown(state))
            moving = self._rotor if self._on_motor else state.v
            self._read = JointState(state.t, q, moving + v)
        return self._read

    def _bounded(self, wanted: Array, v: Array) -> Array:
        """Return a torque inside the torque-speed line.

        The line is a stiff damper where it binds: followed at once it would make a light joint
        swing from step to step. The bounds follow it by the share 1 / (1 + k) a step, with
        k = dt T / (w I) of the lightest pose: v(n+1) = v(n) + dt / I tau(n) then decays for any k
        (the product of its two eigenvalues is k / (1 + k)), and where k is small the line is met.
        """
        low, high = self.limits(v)
        self._low = self._low + self._follow * (low - self._low)
        self._high = self._high + self._follow * (high - self._high)
        return np.clip(wanted, self._low, self._high)

    def _shown(self, state: JointState) -> Array:
        return state.q + self.play if self._on_motor else state.q

    def _through_the_play(self, wanted: Array, v: Array) -> Array:
        """Move the motors against the joints and return the torque that goes through."""
        half, dt = self._half, self._dt
        ahead, behind = self.play >= half, self.play <= -half
        rotor = np.where(ahead | behind, v, self._rotor)
        tau = self._bounded(wanted, rotor)
        pressing = (ahead & (tau >= 0)) | (behind & (tau <= 0))
        rotor = np.where(pressing, v, rotor + dt * tau / self._inertia)
        play = np.where(pressing, self.play, self.play + dt * (rotor - v))
        arrives = ~pressing & (np.abs(play) >= half)
        blow = self._blow + np.where(arrives, self._inertia * (rotor - v), 0.0)
        self.play = np.clip(play, -half, half)
        self._rotor = np.where(arrives, v, rotor)
        # a blow is passed on over as many steps as the stall torque needs for it
        pushed = np.where(pressing | (half == 0), tau, 0.0)
        through = np.clip(pushed + blow / dt, -self._stall, self._stall)
        self._blow = blow - dt * (through - pushed)
        return np.asarray(through)


def _least_inertia(robot: Robot) -> Array:
    """Return the smallest inertia that each joint feels in some sampled poses, (nv,) [kg m^2]."""
    rng = np.random.default_rng(0)
    poses = (robot.random_configuration(rng) for _ in range(_SAMPLED_POSES))
    masses = np.array([robot.mass_matrix(q) for q in poses])
    felt = 1 / np.diagonal(np.linalg.inv(masses), axis1=1, axis2=2)
    return np.asarray(felt.min(axis=0))


def holding_torque(robot: Robot, q: ArrayLike) -> Array:
    """Return the torque that holds an arm against gravity, as far as its limits let it, (nv,)."""
    limit = robot.limits.tau_max
    return np.asarray(np.clip(robot.gravity(q), -limit, limit))

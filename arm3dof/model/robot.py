"""A robot: names, limits, frames and rigid-body dynamics, all computed by Pinocchio from a URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import FrameNotFound, InputError
from arm3dof.model.payload import Payload, centre_of_mass
from arm3dof.state import Array, frozen_array

STANDARD_GRAVITY: tuple[float, ...] = (0.0, 0.0, -9.81)
"""Gravity where nothing else is said, in the base frame [m/s^2]."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Joint limits; every array has shape (nv,).

    Attributes:
        q_min: lowest position [rad]; ``-inf`` for a joint that turns freely.
        q_max: highest position [rad]; ``inf`` for a joint that turns freely.
        v_max: highest speed [rad/s].
        tau_max: highest torque [N m].
    """

    q_min: Array
    q_max: Array
    v_max: Array
    tau_max: Array

    def __post_init__(self) -> None:
        q_min = frozen_array(self.q_min, None, name="q_min")
        object.__setattr__(self, "q_min", q_min)
        for name in ("q_max", "v_max", "tau_max"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), q_min.size, name=name))


@dataclass(frozen=True)
class Description:
    """Where a robot came from: enough to build it, draw it and save it again.

    Attributes:
        source: the name or path that was loaded.
        urdf: the URDF text after overrides, with its shapes and with all its joints.
        package_dirs: folders in which ``package://`` meshes lie.
        locked_joints: joints held fixed, and their positions [rad or m].
        gravity: acceleration of gravity in the base frame [m/s^2].
        payload: what is fixed to the tool beyond the URDF; ``None`` for nothing.
    """

    source: str
    urdf: str
    package_dirs: tuple[Path, ...] = ()
    locked_joints: Mapping[str, float] = field(default_factory=dict)
    gravity: tuple[float, ...] = STANDARD_GRAVITY
    payload: Payload | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "locked_joints", MappingProxyType(dict(self.locked_joints)))

    def to_dict(self) -> dict[str, object]:
        """Return the description as values that JSON can hold."""
        return {
            "source": self.source,
            "urdf": self.urdf,
            "package_dirs": [str(folder) for folder in self.package_dirs],
            "locked_joints": dict(self.locked_joints),
            "gravity": list(self.gravity),
            "payload": None if self.payload is None else self.payload.to_dict(),
        }

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Description:
        """Return the description that ``to_dict`` wrote; without a payload it carries none.

        Raises:
            KeyError: a value is missing.
        """
        payload = values.get("payload")
        return Description(
            source=str(values["source"]),
            urdf=str(values["urdf"]),
            package_dirs=tuple(Path(folder) for folder in values["package_dirs"]),
            locked_joints={name: float(q) for name, q in values["locked_joints"].items()},
            gravity=tuple(float(g) for g in values["gravity"]),
            payload=None if payload is None else Payload.from_dict(payload),
        )


class Robot:
    """A fixed-base arm with one-degree-of-freedom joints, so that nq == nv.

    Joint order is Pinocchio's. All methods take and return SI units, and each result is a fresh
    array. A robot owns one ``pinocchio.Data``: give each thread a robot of its own (``clone``).

    Attributes:
        name: the robot's name in the URDF.
        joint_names: names of the joints that move, in order.
        limits: position, velocity and torque limits.
        tool_frame: the frame that is brought to a target.
        damping: viscous friction of each joint, shape (nv,) [N m s/rad].
        friction: Coulomb friction of each joint, shape (nv,) [N m].
        description: the source, the URDF text and the payload that this robot was built from.
    """

    def __init__(
        self,
        model: pin.Model,
        *,
        limits: Limits,
        tool_frame: str,
        damping: ArrayLike,
        friction: ArrayLike,
        description: Description,
    ) -> None:
        self._bare_model = model
        self.name: str = model.name
        self.joint_names: tuple[str, ...] = tuple(model.names[1:])
        self.limits = limits
        self.damping = frozen_array(damping, model.nv, name="damping")
        self.friction = frozen_array(friction, model.nv, name="friction")
        self.description = description
        self._frames = _frame_indices(model)
        tool = self._frame_id(tool_frame)
        self.tool_frame = tool_frame
        self._model = model if self.payload is None else self.payload.attach(model, tool)
        self._data = self._model.createData()
        self._inertias = self._model.inertias  # of the world, which moves nothing, and the bodies
        self._bodies = [body.copy() for body in list(self._inertias)[1:]]

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, joints={list(self.joint_names)}, tool={self.tool_frame!r})"

    def clone(self) -> Robot:
        """Return an independent robot with the same model, safe to use in another thread."""
        return self._copy(self.description)

    @property
    def model(self) -> pin.Model:
        """The Pinocchio model; read it, never write to it."""
        return self._model

    @property
    def nv(self) -> int:
        """Number of joints (and of velocities and torques)."""
        return int(self._model.nv)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames, links and joints included."""
        return tuple(self._frames)

    @property
    def gravity_acceleration(self) -> Array:
        """Gravity in the base frame, shape (3,) [m/s^2]."""
        return np.array(self._model.gravity.linear)

    @property
    def bodies(self) -> Sequence[pin.Inertia]:
        """Mass, centre and inertia of the body behind each joint, nv of them; only to be read."""
        return self._bodies

    def reweigh(self, bodies: Sequence[pin.Inertia]) -> None:
        """Give the bodies behind the joints other masses, centres and inertias.

        Unlike all else this changes the robot itself, so it is for who owns it alone.

        Args:
            bodies: nv of them, each in its joint's frame.

        Raises:
            InputError: there are more or fewer; the robot stays as it was.
        """
        if len(bodies) != len(self._bodies):
            raise InputError(f"bodies has {len(bodies)} entries; {self.name} has {self.nv} joints")
        for joint, body in enumerate(bodies, start=1):
            self._inertias[joint] = body
        self._bodies = list(bodies)

    # ---- payload ---------------------------------------------------------------------------

    @property
    def payload(self) -> Payload | None:
        """What is attached to the tool; ``None`` for nothing."""
        return self.description.payload

    def with_payload(self, mass: float, com: ArrayLike = (0.0, 0.0, 0.0)) -> Robot:
        """Return a robot that carries a point mass at its tool, instead of what it carries now.

        Its limits and friction stay; this robot is unchanged.

        Args:
            mass: mass of the payload [kg].
            com: its place in the tool frame, shape (3,) [m].

        Raises:
            InputError: the mass is negative or not finite, or ``com`` is not three finite numbers.
        """
        payload = Payload(mass, centre_of_mass(com))
        return self._copy(replace(self.description, payload=payload))

    def without_payload(self) -> Robot:
        """Return the robot with nothing attached, its dynamics as they were to the last bit."""
        return self._copy(replace(self.description, payload=None))

    # ---- kinematics ------------------------------------------------------------------------

    def placement(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Return the pose of a frame in the base frame.

        Args:
            q: joint positions, shape (nv,) [rad].
            frame: frame name; the tool when ``None``.

        Raises:
            FrameNotFound: the robot has no such frame.
            InputError: ``q`` has another shape.
        """
        index = self._frame_id(frame or self.tool_frame)
        pin.forwardKinematics(self._model, self._data, self._vector(q, "q"))
        return pin.updateFramePlacement(self._model, self._data, index).copy()

    def placements(self, q: ArrayLike, frames: Sequence[str]) -> list[pin.SE3]:
        """Return the poses of some frames in the base frame.

        Args:
            q: joint positions, shape (nv,) [rad].
            frames: their names.

        Raises:
            FrameNotFound: the robot has no such frame.
            InputError: ``q`` has another shape.
        """
        indices = [self._frame_id(frame) for frame in frames]
        pin.forwardKinematics(self._model, self._data, self._vector(q, "q"))
        return [
            pin.updateFramePlacement(self._model, self._data, index).copy() for index in indices
        ]

    def jacobian(self, q: ArrayLike, frame: str | None = None) -> Array:
        """Return the frame's Jacobian along the base axes, linear rows first, shape (6, nv).

        Args:
            q: joint positions, shape (nv,) [rad].
            frame: frame name; the tool when ``None``.

        Raises:
            FrameNotFound: the robot has no such frame.
            InputError: ``q`` has another shape.
        """
        index = self._frame_id(frame or self.tool_frame)
        jacobian = pin.computeFrameJacobian(
            self._model, self._data, self._vector(q, "q"), index, pin.LOCAL_WORLD_ALIGNED
        )
        return np.array(jacobian).reshape(6, self.nv)  # of one joint, Pinocchio makes a vector

    # ---- dynamics --------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q) of (19), symmetric, shape (nv, nv) [kg m^2] (CRBA).

        Raises:
            InputError: ``q`` has another shape.
        """
        return np.array(pin.crba(self._model, self._data, self._vector(q, "q")))

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the Christoffel matrix C(q, v), shape (nv, nv) [kg m^2/s].

        ``C @ v`` is the paper's N(q, v) v, and dM/dt - 2 C is skew-symmetric.

        Raises:
            InputError: ``q`` or ``v`` has another shape.
        """
        return np.array(
            pin.computeCoriolisMatrix(
                self._model, self._data, self._vector(q, "q"), self._vector(v, "v")
            )
        )

    def gravity(self, q: ArrayLike) -> Array:
        """Return g(q) of (19): the torque that holds the arm still, shape (nv,) [N m].

        Raises:
            InputError: ``q`` has another shape.
        """
        return np.array(
            pin.computeGeneralizedGravity(self._model, self._data, self._vector(q, "q"))
        )

    def friction_torque(self, v: ArrayLike) -> Array:
        """Return the torque that joint friction takes, shape (nv,) [N m].

        It is ``damping * v + friction * sign(v)``, as the URDF's ``<dynamics>`` states it.

        Raises:
            InputError: ``v`` has another shape.
        """
        v = self._vector(v, "v")
        return self.damping * v + self.friction * np.sign(v)

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Return the torque that gives acceleration ``a``, joint friction included.

        Args:
            q: joint positions, shape (nv,) [rad].
            v: joint velocities, shape (nv,) [rad/s].
            a: joint accelerations, shape (nv,) [rad/s^2].

        Returns:
            Torque, shape (nv,) [N m].

        Raises:
            InputError: an argument has another shape.
        """
        q, v, a = self._vector(q, "q"), self._vector(v, "v"), self._vector(a, "a")
        return np.array(pin.rnea(self._model, self._data, q, v, a)) + self.friction_torque(v)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Return the acceleration that a torque gives, joint friction included.

        Args:
            q: joint positions, shape (nv,) [rad].
            v: joint velocities, shape (nv,) [rad/s].
            tau: joint torques, shape (nv,) [N m].

        Returns:
            Acceleration, shape (nv,) [rad/s^2].

        Raises:
            InputError: an argument has another shape.
        """
        q, v, tau = self._vector(q, "q"), self._vector(v, "v"), self._vector(tau, "tau")
        net = tau - self.friction_torque(v)
        return np.array(pin.aba(self._model, self._data, q, v, net))

    # ---- helpers ---------------------------------------------------------------------------

    def random_configuration(self, rng: np.random.Generator) -> Array:
        """Return a position drawn uniformly inside the limits, shape (nv,) [rad].

        A joint without limits is drawn from one turn.
        """
        start, width = self._drawn_from
        return start + width * rng.random(self.nv)

    @cached_property
    def _drawn_from(self) -> tuple[Array, Array]:
        """Where random positions begin, and how far they reach, shape (nv,) each [rad]."""
        low = np.where(np.isfinite(self.limits.q_min), self.limits.q_min, -np.pi)
        high = np.where(np.isfinite(self.limits.q_max), self.limits.q_max, np.pi)
        return low, high - low

    def _copy(self, description: Description) -> Robot:
        return Robot(
            pin.Model(self._bare_model),
            limits=self.limits,
            tool_frame=self.tool_frame,
            damping=self.damping,
            friction=self.friction,
            description=description,
        )

    def _vector(self, values: ArrayLike, name: str) -> Array:
        return frozen_array(values, self.nv, name=name)

    def _frame_id(self, frame: str) -> int:
        try:
            return self._frames[frame]
        except KeyError:
            raise FrameNotFound(frame, self._frames) from None


def _frame_indices(model: pin.Model) -> dict[str, int]:
    """Return the index of each frame; where a joint and a link share a name, the link's."""
    indices: dict[str, int] = {}
    for index, frame in enumerate(model.frames):
        if frame.type == pin.FrameType.BODY or frame.name not in indices:
            indices[frame.name] = index
    return indices

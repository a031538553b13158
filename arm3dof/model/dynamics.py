"""The paper's hand-derived dynamics (16)-(21) in closed form, for any robot that fits its chain.

Pinocchio computes the same matrices by recursion over the links. Here they are explicit sums,
with the link parameters that the paper names; the paper itself leaves M and N out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.model import _closed_form_terms as terms
from arm3dof.model.dh import DhGeometry, link_transforms
from arm3dof.model.robot import Robot
from arm3dof.state import Array, frozen_array


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """M(q), N(q, v) and g(q) of (19), in the joint coordinates of the robot they were read from.

    The link parameters are the paper's. Each row of ``centroids`` is written in the frame at the
    **far** end of its link, as (19) needs it: (a2 + x_c2) is the distance along link 2 from the
    shoulder. Frames 1 and 2 share their origin, so for link 1 near and far end are one place.
    Joint friction, damping and rotor inertia are no part of (19).

    Attributes:
        geometry: the chain, and how its angles follow from the robot's joint positions.
        masses: m_1, m_2, m_3, shape (3,) [kg].
        centroids: (x_c, y_c, z_c) of each link along its own frame's axes, shape (3, 3) [m].
        tensors: inertia tensor (20) of each link about its centroid, along its own frame's axes,
            shape (3, 3, 3) [kg m^2].
        gravity_acceleration: gravity in DH frame 0, shape (3,) [m/s^2]; the paper's is
            (0, 0, -g0), other directions are taken too.
    """

    geometry: DhGeometry
    masses: Array
    centroids: Array
    tensors: Array
    gravity_acceleration: Array
    _sums: terms.Lumped = field(init=False, repr=False)

    def __post_init__(self) -> None:
        shapes = {
            "masses": (3,),
            "centroids": (3, 3),
            "tensors": (3, 3, 3),
            "gravity_acceleration": (3,),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen_array(getattr(self, name), *shape, name=name))
        object.__setattr__(self, "_sums", _lump(self))

    @classmethod
    def from_robot(cls, robot: Robot) -> ClosedForm:
        """Read the link parameters from a robot.

        Bodies that are fixed to a link count as part of it.

        Raises:
            DhMisfit: the robot's kinematics are not the paper's chain.
        """
        geometry = DhGeometry.from_robot(robot)
        inertias = _inertias_in_dh_frames(robot, geometry)
        far_ends = np.zeros((3, 3))
        far_ends[1:, 0] = geometry.a2, geometry.a3
        return cls(
            geometry=geometry,
            masses=np.array([inertia.mass for inertia in inertias]),
            centroids=np.array([inertia.lever for inertia in inertias]) - far_ends,
            tensors=np.array([inertia.inertia for inertia in inertias]),
            gravity_acceleration=geometry.transform_base_dh[:3, :3].T @ robot.gravity_acceleration,
        )

    @property
    def a2(self) -> float:
        """Upper arm [m]."""
        return self.geometry.a2

    @property
    def a3(self) -> float:
        """Forearm [m]."""
        return self.geometry.a3

    @property
    def g0(self) -> float:
        """Gravity along -z of frame 0 [m/s^2]; all of it when the first joint is upright."""
        return float(-self.gravity_acceleration[2])

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q) of (19).

        Args:
            q: joint positions, shape (..., 3) [rad].

        Returns:
            Symmetric positive definite matrices, shape (..., 3, 3) [kg m^2].

        Raises:
            InputError: ``q`` has another shape.
        """
        sign = self.geometry.sign
        return terms.mass_matrix(self._sums, self.geometry.to_dh(q)) * np.outer(sign, sign)

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return N(q, v) of (19) as the Christoffel matrix, for which dM/dt - 2 N is skew.

        Args:
            q: joint positions, shape (..., 3) [rad].
            v: joint velocities, of the same shape [rad/s].

        Returns:
            Matrices, shape (..., 3, 3) [kg m^2/s]; ``N @ v`` is the Coriolis torque.

        Raises:
            InputError: ``q`` or ``v`` has another shape.
        """
        sign, theta = self.geometry.sign, self.geometry.to_dh(q)
        if np.shape(v) != theta.shape:
            raise InputError(f"v has shape {np.shape(v)}; give that of q, {theta.shape}")
        rates = sign * np.asarray(v, dtype=np.float64)
        return terms.coriolis(self._sums, theta, rates) * np.outer(sign, sign)

    def gravity(self, q: ArrayLike) -> Array:
        """Return g(q) of (19): the torque that holds the arm still.

        Args:
            q: joint positions, shape (..., 3) [rad].

        Returns:
            Torques, shape (..., 3) [N m].

        Raises:
            InputError: ``q`` has another shape.
        """
        return terms.gravity(self._sums, self.geometry.to_dh(q)) * self.geometry.sign


def _inertias_in_dh_frames(robot: Robot, geometry: DhGeometry) -> list[pin.Inertia]:
    """Return each moving body's inertia in the DH frame that moves with it."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, np.zeros(3))
    frame = geometry.transform_base_dh
    moves = link_transforms(geometry.offset, geometry.a2, geometry.a3)[:3]
    bodies = zip(moves, data.oMi[1:], robot.model.inertias[1:], strict=True)
    inertias = []
    for move, transform_base_joint, inertia in bodies:
        frame = frame @ move
        inertias.append((pin.SE3(frame).inverse() * transform_base_joint).act(inertia))
    return inertias


def _lump(arm: ClosedForm) -> terms.Lumped:
    """Add the link parameters up to the sums of the closed form."""
    near_ends = np.array([[0.0, 0.0, 0.0], [arm.a2, 0.0, 0.0], [arm.a3, 0.0, 0.0]])
    levers = arm.centroids + near_ends
    first = arm.masses[:, None] * levers
    squares = np.einsum("ik,ik->i", levers, levers)[:, None, None] * np.eye(3)
    spread = squares - levers[:, :, None] * levers[:, None, :]
    second = arm.tensors + arm.masses[:, None, None] * spread
    m3, a2 = arm.masses[2], arm.a2
    # link 2 carries the mass of link 3 at the elbow, and the lever of its lateral offset
    first[1, 0] += m3 * a2
    second[1] += np.diag([0.0, m3 * a2**2, m3 * a2**2])
    second[1, 0, 2] -= a2 * first[2, 2]
    sums = {"a2": a2, "J1_zz": second[0, 2, 2], "h1_x": first[0, 0], "h1_y": first[0, 1]}
    for link in (2, 3):
        for i, row in enumerate("xyz"):
            sums[f"h{link}_{row}"] = first[link - 1, i]
            for k in range(i, 3):
                sums[f"J{link}_{row}{'xyz'[k]}"] = second[link - 1, i, k]
    for axis, component in zip("xyz", arm.gravity_acceleration, strict=True):
        sums[f"g_{axis}"] = component
    return terms.Lumped(**{name: float(value) for name, value in sums.items()})

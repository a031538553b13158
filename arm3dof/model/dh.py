"""The paper's modified Denavit-Hartenberg chain, and its fit to the kinematics of any robot.

The paper describes a shoulder with two axes that meet at right angles, and an elbow parallel to
the second one: Table I, (3)-(7). ``fit_dh`` looks for this chain in a robot's own kinematics,
whatever its joint frames, axis signs and zero positions are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import InputError, Problem
from arm3dof.model.robot import Robot
from arm3dof.state import Array, frozen_array


class DhRow(NamedTuple):
    """One row of Table I, in the modified convention: ``a`` and ``alpha`` lead to the next frame.

    Attributes:
        a: distance from z_i to z_i+1 along x_i [m].
        alpha: angle from z_i to z_i+1 about x_i [rad].
        d: distance from x_i-1 to x_i along z_i [m].
    """

    a: float
    alpha: float
    d: float


def dh_table(a2: float, a3: float) -> tuple[DhRow, DhRow, DhRow, DhRow]:
    """Return Table I for an arm with upper arm ``a2`` and forearm ``a3`` [m]."""
    return (
        DhRow(0.0, np.pi / 2, 0.0),
        DhRow(a2, 0.0, 0.0),
        DhRow(a3, 0.0, 0.0),
        DhRow(0.0, 0.0, 0.0),
    )


def link_transform(a: float, alpha: float, d: float, theta: ArrayLike) -> Array:
    """Return the transform (3) of frame i in frame i-1.

    Args:
        a: a_i-1, of the row before [m].
        alpha: alpha_i-1, of the row before [rad]; right angles are taken exactly.
        d: d_i [m].
        theta: theta_i, shape (...) [rad].

    Returns:
        Homogeneous transforms, shape (..., 4, 4).
    """
    theta = np.asarray(theta, dtype=np.float64)
    c, s = np.cos(theta), np.sin(theta)
    ca, sa = _cos_sin(alpha)
    transform = np.zeros((*theta.shape, 4, 4))
    transform[..., 0, 0], transform[..., 0, 1], transform[..., 0, 3] = c, -s, a
    transform[..., 1, 0], transform[..., 1, 1] = s * ca, c * ca
    transform[..., 1, 2], transform[..., 1, 3] = -sa, -sa * d
    transform[..., 2, 0], transform[..., 2, 1] = s * sa, c * sa
    transform[..., 2, 2], transform[..., 2, 3] = ca, ca * d
    transform[..., 3, 3] = 1.0
    return transform


def link_transforms(theta: ArrayLike, a2: float, a3: float) -> tuple[Array, Array, Array, Array]:
    """Return the four transforms (4): frame 1 in 0, 2 in 1, 3 in 2 and 4 in 3.

    Args:
        theta: joint angles of the DH chain, shape (..., 3) [rad].
        a2: upper arm [m].
        a3: forearm [m].

    Returns:
        Four arrays, each of shape (..., 4, 4).
    """
    angles = _angles(theta)
    one, two, three, four = dh_table(a2, a3)
    return (
        link_transform(0.0, 0.0, one.d, angles[..., 0]),
        link_transform(one.a, one.alpha, two.d, angles[..., 1]),
        link_transform(two.a, two.alpha, three.d, angles[..., 2]),
        link_transform(three.a, three.alpha, four.d, np.zeros(angles.shape[:-1])),
    )


def chain(theta: ArrayLike, a2: float, a3: float) -> Array:
    """Return the transform (5) of the tool frame 4 in frame 0, as the product of (4).

    Args:
        theta: joint angles of the DH chain, shape (..., 3) [rad].
        a2: upper arm [m].
        a3: forearm [m].

    Returns:
        Homogeneous transforms, shape (..., 4, 4).
    """
    t01, t12, t23, t34 = link_transforms(theta, a2, a3)
    return np.asarray(t01 @ t12 @ t23 @ t34)


def rotation(theta: ArrayLike) -> Array:
    """Return the rotation (6) of the tool frame 4 in frame 0.

    Args:
        theta: joint angles of the DH chain, shape (..., 3) [rad].

    Returns:
        Rotation matrices, shape (..., 3, 3).
    """
    angles = _angles(theta)
    c1, s1 = np.cos(angles[..., 0]), np.sin(angles[..., 0])
    c23, s23 = np.cos(angles[..., 1] + angles[..., 2]), np.sin(angles[..., 1] + angles[..., 2])
    rows = [[c1 * c23, -c1 * s23, s1], [s1 * c23, -s1 * s23, -c1], [s23, c23, np.zeros_like(c1)]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def position(theta: ArrayLike, a2: float, a3: float) -> Array:
    """Return the position (7) of the tool point in frame 0.

    Args:
        theta: joint angles of the DH chain, shape (..., 3) [rad].
        a2: upper arm [m].
        a3: forearm [m].

    Returns:
        Points, shape (..., 3) [m].
    """
    angles = _angles(theta)
    theta1, theta2, theta23 = angles[..., 0], angles[..., 1], angles[..., 1] + angles[..., 2]
    reach = a2 * np.cos(theta2) + a3 * np.cos(theta23)
    height = a2 * np.sin(theta2) + a3 * np.sin(theta23)
    return np.stack([reach * np.cos(theta1), reach * np.sin(theta1), height], axis=-1)


class DhMisfit(InputError):
    """A robot's kinematics are not the paper's chain.

    Attributes:
        problem: where it differs, how, and what to do.
    """

    def __init__(self, source: str, problem: Problem) -> None:
        self.problem = problem
        super().__init__(f"{source} does not fit the paper's chain: {problem}")


@dataclass(frozen=True, eq=False)
class DhGeometry:
    """The paper's chain as found in a robot: ``theta = sign * q + offset``.

    Frame 0 has its origin where joint axes 1 and 2 meet. Its z-axis is joint 1's, turned upwards
    (against gravity); its x-axis is the base frame's as nearly as z allows, so that an arm with an
    upright first joint has frame 0 parallel to its base. Joint 2's sense is the one that puts the
    tool of the robot's zero pose in front (theta1 points to it).

    Attributes:
        transform_base_dh: pose of DH frame 0 in the robot's base frame, shape (4, 4).
        a2: upper arm, from joint axis 2 to joint axis 3 [m].
        a3: forearm, from joint axis 3 to the tool point [m].
        sign: +1 or -1 for each joint, shape (3,).
        offset: DH angles of the robot's zero pose, shape (3,) [rad].
    """

    transform_base_dh: Array
    a2: float
    a3: float
    sign: Array
    offset: Array

    def __post_init__(self) -> None:
        transform = frozen_array(self.transform_base_dh, 4, 4, name="transform_base_dh")
        object.__setattr__(self, "transform_base_dh", transform)
        object.__setattr__(self, "sign", frozen_array(self.sign, 3, name="sign"))
        object.__setattr__(self, "offset", frozen_array(self.offset, 3, name="offset"))

    @classmethod
    def from_robot(cls, robot: Robot, *, tolerance: float = 1e-9) -> DhGeometry:
        """Find the paper's chain in a robot.

        Raises:
            DhMisfit: the robot's kinematics differ (see ``fit_dh``).
        """
        fit = fit_dh(robot, tolerance=tolerance)
        if isinstance(fit, Problem):
            raise DhMisfit(robot.name, fit)
        return fit

    def to_dh(self, q: ArrayLike) -> Array:
        """Return the DH angles of robot joint positions, shape (..., 3) [rad]."""
        return self.sign * _angles(q) + self.offset

    def from_dh(self, theta: ArrayLike) -> Array:
        """Return the robot joint positions of DH angles, shape (..., 3) [rad], not wrapped."""
        return self.sign * (_angles(theta) - self.offset)

    def tool_position(self, q: ArrayLike) -> Array:
        """Return the tool point in the robot's base frame by (7).

        Args:
            q: joint positions of the robot, shape (..., 3) [rad].

        Returns:
            Points, shape (..., 3) [m].
        """
        p_dh = position(self.to_dh(q), self.a2, self.a3)
        return np.asarray(p_dh @ self.transform_base_dh[:3, :3].T + self.transform_base_dh[:3, 3])


def fit_dh(robot: Robot, *, tolerance: float = 1e-9) -> DhGeometry | Problem:
    """Look for the paper's chain in a robot's kinematics.

    Args:
        robot: any robot.
        tolerance: how far axes may be from parallel, perpendicular [rad], crossing or the arm's
            plane [m]. The default keeps the chain exact to round-off.

    Returns:
        The chain, or the first thing that does not fit: not three revolute joints in a row; axis
        2 does not meet axis 1 at a right angle; axis 3 is not parallel to axis 2 or coincides
        with it; the tool lies beside the arm's plane or on axis 3.
    """
    problem = _joint_problem(robot)
    if problem is not None:
        return problem
    axes, points, tool = _axes(robot)
    problem = _axis_problem(robot, axes, points, tool, tolerance)
    if problem is not None:
        return problem
    up = -robot.gravity_acceleration
    sign1 = -1.0 if axes[0] @ up < -1e-6 * np.linalg.norm(up) else 1.0
    z0 = sign1 * axes[0]
    origin = points[0] + axes[0] * ((points[1] - points[0]) @ axes[0])
    forward = np.cross(z0, axes[1])
    sign2 = -1.0 if (tool - origin) @ forward < -tolerance else 1.0
    z2, x1 = sign2 * axes[1], _unit(sign2 * forward)
    sign3 = float(np.sign(axes[2] @ z2))
    link2, link3 = _across(points[2] - origin, z2), _across(tool - points[2], z2)
    x0 = _horizontal(z0)
    offset = [_angle(x0, x1, z0), _angle(x1, link2, z2), _angle(link2, link3, z2)]
    transform = np.eye(4)
    transform[:3, :3] = np.column_stack([x0, np.cross(z0, x0), z0])
    transform[:3, 3] = origin
    a2, a3 = float(np.linalg.norm(link2)), float(np.linalg.norm(link3))
    return DhGeometry(transform, a2, a3, np.array([sign1, sign2, sign3]), np.array(offset))


# ---- the fit's parts -----------------------------------------------------------------------


def _joint_problem(robot: Robot) -> Problem | None:
    """Return what is wrong with the number, kind or order of the joints."""
    if robot.nv != 3:
        return Problem(
            f"robot '{robot.name}'",
            f"has {robot.nv} moving joints; the chain has 3",
            "lock the others, or use the numerical inverse kinematics",
        )
    parent = robot.model.frames[robot.model.getFrameId(robot.tool_frame)].parentJoint
    if [*robot.model.parents[2:], parent] != [1, 2, 3]:
        return Problem(
            f"robot '{robot.name}'",
            f"its joints and tool '{robot.tool_frame}' do not follow one another in one chain",
            "choose a tool frame on the last link, or lock the side branch",
        )
    for joint, name in zip(robot.model.joints[1:], robot.joint_names, strict=True):
        if not joint.shortname().startswith("JointModelR"):
            return Problem(
                f"joint '{name}'",
                f"is not revolute ({joint.shortname().removeprefix('JointModel')})",
                "lock it, or use the numerical inverse kinematics",
            )
    return None


def _axes(robot: Robot) -> tuple[Array, Array, Array]:
    """Return joint axes (3, 3), points on them (3, 3) and the tool (3,) in the zero pose."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, np.zeros(3))
    axes = np.array([_unit(column) for column in data.J[3:].T])
    points = np.array([placement.translation for placement in data.oMi[1:]])
    return axes, points, np.array(robot.placement(np.zeros(3)).translation)


def _axis_problem(
    robot: Robot, axes: Array, points: Array, tool: Array, tolerance: float
) -> Problem | None:
    """Return the first axis, or tool point, that is not where the chain needs it."""
    one, two, three = (f"joint '{name}'" for name in robot.joint_names)
    tool_name = f"tool frame '{robot.tool_frame}'"
    skew = np.arcsin(min(1.0, abs(axes[0] @ axes[1])))
    if skew > tolerance:
        what = f"its axis is {_degrees(skew)} from perpendicular to {one}'s"
        return Problem(two, what, _cure(skew))
    gap = abs((points[1] - points[0]) @ np.cross(axes[0], axes[1]))
    if gap > tolerance:
        what = f"its axis passes {one}'s at a distance of {gap:.3g} m; they have to meet"
        return Problem(two, what, _cure(gap))
    tilt = np.arcsin(min(1.0, float(np.linalg.norm(np.cross(axes[1], axes[2])))))
    if tilt > tolerance:
        what = f"its axis is not parallel to {two}'s (angle {_degrees(tilt)})"
        return Problem(three, what, _cure(tilt))
    lengths = [
        np.linalg.norm(_across(points[2] - points[1], axes[1])),
        np.linalg.norm(_across(tool - points[2], axes[1])),
    ]
    if lengths[0] <= tolerance:
        return Problem(three, f"its axis is {two}'s: the upper arm has no length", _cure(1.0))
    if lengths[1] <= tolerance:
        what = f"lies on the axis of {three}: the forearm has no length"
        return Problem(tool_name, what, "choose a tool frame further out")
    beside = abs((tool - points[0]) @ axes[1])
    if beside > tolerance:
        what = f"lies {beside:.3g} m beside the plane in which the arm bends"
        return Problem(tool_name, what, _cure(beside))
    return None


def _cure(error: float) -> str:
    """Return the cure for a misfit of this size [rad or m]."""
    if error < 1e-4:
        return (
            "write the description's lengths and angles with all digits "
            "(a right angle is 1.5707963267948966)"
        )
    return "use the numerical inverse kinematics and Pinocchio's dynamics"


def _degrees(angle: float) -> str:
    return f"{np.degrees(angle):.3g} deg"


def _horizontal(z: Array) -> Array:
    """Return the unit vector across ``z`` that is nearest the base's x-axis (or y-axis)."""
    base_axis = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    return _unit(_across(base_axis, z))


def _across(vector: Array, axis: Array) -> Array:
    """Return the part of a vector that is perpendicular to a unit axis."""
    return np.asarray(vector - axis * (vector @ axis))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _angle(start: Array, end: Array, axis: Array) -> float:
    """Return the angle from one vector to another about a unit axis, in (-pi, pi] [rad]."""
    return float(np.arctan2(np.cross(start, end) @ axis, start @ end))


def _angles(values: ArrayLike) -> Array:
    """Return joint angles as an array of shape (..., 3)."""
    angles = np.asarray(values, dtype=np.float64)
    if angles.ndim == 0 or angles.shape[-1] != 3:
        raise InputError(f"joint angles have shape {angles.shape}; give shape (..., 3)")
    return angles


def _cos_sin(alpha: float) -> tuple[float, float]:
    """Return cosine and sine, exact at multiples of a right angle."""
    quarters = alpha / (np.pi / 2)
    if quarters == round(quarters):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    return float(np.cos(alpha)), float(np.sin(alpha))

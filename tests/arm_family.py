"""Random arms of the paper's kind, written as URDF the way strangers write it.

Joint frames are turned and shifted at will along their axes, axes have either sign, zero poses are
anywhere, inertias are those of random clouds of points in turned frames, and a part is fixed to
every link.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm3dof.model.build import robot_from_description
from arm3dof.model.dh import link_transforms
from arm3dof.model.robot import Description, Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RandomArm:
    """A robot and the lengths that it was made with [m]."""

    robot: Robot
    a2: float
    a3: float


def random_rotation(rng: np.random.Generator) -> Array:
    quaternion = rng.normal(size=4)
    return pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()


def pose(rotation: Array, translation: Array) -> Array:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, translation
    return transform


def words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)


def origin(transform: Array) -> str:
    rpy = pin.rpy.matrixToRpy(transform[:3, :3])
    return f'<origin xyz="{words(transform[:3, 3])}" rpy="{words(rpy)}"/>'


def inertial(rng: np.random.Generator) -> str:
    """Return the inertia of a random cloud of points about its centroid."""
    points = rng.normal(size=(6, 3)) * rng.uniform(0.005, 0.08, 3)
    weights = rng.uniform(0.005, 0.05, 6)
    points -= weights @ points / weights.sum()
    tensor = np.einsum("n,nk,nk->", weights, points, points) * np.eye(3)
    tensor -= np.einsum("n,ni,nk->ik", weights, points, points)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
    place = origin(pose(random_rotation(rng), rng.uniform(-0.1, 0.1, 3)))
    return (
        f'<inertial>{place}<mass value="{float(weights.sum())!r}"/>'
        f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>'
    )


def joint(name: str, parent: str, child: str, transform: Array, axis: Array | None) -> str:
    if axis is None:
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        return f'<joint name="{name}" type="fixed">{origin(transform)}{ends}</joint>'
    return (
        f'<joint name="{name}" type="revolute">{origin(transform)}'
        f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{words(axis)}"/>'
        '<limit lower="-3" upper="3" effort="2" velocity="7"/></joint>'
    )


def random_arm(rng: np.random.Generator, *, upright: bool, gravity: float = 9.81) -> RandomArm:
    """Draw an arm; an upright one has its first axis along the base's z."""
    a2, a3 = rng.uniform(0.05, 0.6, 2)
    theta0, sign = rng.uniform(-np.pi, np.pi, 3), rng.choice([-1.0, 1.0], 3)
    base = pose(np.eye(3) if upright else random_rotation(rng), rng.uniform(-0.5, 0.5, 3))
    frame, before, links, joints = base, np.eye(4), [], []
    for i, move in enumerate(link_transforms(theta0, a2, a3)[:3]):
        frame = frame @ move
        slide = np.array([0.0, 0.0, rng.uniform(-0.1, 0.1)])
        turn = random_rotation(rng)
        here = frame @ pose(turn, slide)
        name, parent = f"link{i + 1}", f"link{i}" if i else "base"
        axis = sign[i] * turn.T[:, 2]
        joints.append(joint(f"joint{i + 1}", parent, name, np.linalg.inv(before) @ here, axis))
        joints.append(
            joint(f"bolt{i + 1}", name, f"part{i + 1}", pose(random_rotation(rng), slide), None)
        )
        links += [f'<link name="{part}">{inertial(rng)}</link>' for part in (name, f"part{i + 1}")]
        before = here
    tool = np.linalg.inv(before) @ frame @ link_transforms(theta0, a2, a3)[3]
    joints.append(joint("tool_joint", "link3", "tool", tool, None))
    text = f'<robot name="random"><link name="base"/>{"".join(links)}<link name="tool"/>'
    text += "".join(joints) + "</robot>"
    description = Description("random arm", text, gravity=(0.0, 0.0, -gravity))
    robot = robot_from_description(description, "tool")
    return RandomArm(robot, float(a2), float(a3))

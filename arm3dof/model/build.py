"""From a description to a robot: what was validated, and nothing else, is handed to Pinocchio."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.errors import RobotError
from arm3dof.model.robot import Description, Limits, Robot
from arm3dof.model.tree import chain_to, placement
from arm3dof.model.urdf import Inertial, Joint, Urdf, read_urdf
from arm3dof.model.validate import judge

TOOL_NAMES = (
    "tool",
    "tool0",
    "tcp",
    "tool_link",
    "tool_frame",
    "tcp_link",
    "tcp_frame",
    "ee_link",
    "ee_frame",
    "end_effector",
    "end_effector_link",
    "gripper_frame_link",
)
"""Names, best first, by which a link is taken for the tool."""

_FREE = 1e17  # limit of a joint that turns freely, for urdfdom, which cannot read "inf"


def robot_from_description(description: Description, tool_frame: str | None = None) -> Robot:
    """Build a robot from its description alone; no file is read.

    Args:
        description: URDF text, locked joints and gravity.
        tool_frame: the frame to bring to targets; ``default_tool`` when None.

    Raises:
        RobotError: the URDF is broken or unsupported.
        FrameNotFound: the robot has no such tool frame.
    """
    urdf, problems = read_urdf(description.urdf)
    if urdf is not None:
        problems += judge(urdf, description.locked_joints)
    if urdf is None or problems:
        raise RobotError(description.source, problems)
    return build_robot(urdf, description, tool_frame)


def build_robot(urdf: Urdf, description: Description, tool_frame: str | None) -> Robot:
    """Build a robot from a URDF that has no problems.

    Args:
        urdf: the robot as read from ``description.urdf``.
        description: where it came from.
        tool_frame: the frame to bring to targets; ``default_tool`` when None.

    Raises:
        FrameNotFound: the robot has no such tool frame.
    """
    locked = description.locked_joints
    model = pin.buildModelFromXML(pinocchio_text(urdf, locked))
    model.gravity.linear = np.array(description.gravity)
    by_name = {joint.name: joint for joint in urdf.joints}
    joints = [by_name[name] for name in model.names[1:]]
    limits = Limits(
        q_min=np.array([joint.lower for joint in joints]),
        q_max=np.array([joint.upper for joint in joints]),
        v_max=np.array([joint.velocity for joint in joints]),
        tau_max=np.array([joint.effort for joint in joints]),
    )
    model.lowerPositionLimit = limits.q_min
    model.upperPositionLimit = limits.q_max
    return Robot(
        model,
        limits=limits,
        tool_frame=tool_frame or default_tool(urdf, locked),
        damping=[joint.damping for joint in joints],
        friction=[joint.friction for joint in joints],
        description=description,
    )


def default_tool(urdf: Urdf, locked: Mapping[str, float]) -> str:
    """Choose the link that is brought to targets.

    It is the first link that moves and is called by one of ``TOOL_NAMES`` (``left_tool0`` counts
    as ``tool0``, an exact name goes first); else the last link of the chain with most moving
    joints, and among its leaves the one with most links above it, the first in the file on a tie.

    Args:
        urdf: a robot without problems.
        locked: joints held fixed.
    """
    depth: dict[str, tuple[int, int]] = {}
    for link in urdf.links:
        chain = chain_to(urdf, link.name)
        moving = sum(joint.moves and joint.name not in locked for joint in chain)
        if moving:
            depth[link.name] = (moving, len(chain))
    for tool in TOOL_NAMES:
        if tool in depth:
            return tool
    for tool in TOOL_NAMES:
        for name in depth:
            if name.endswith("_" + tool):
                return name
    return max(depth, key=depth.__getitem__)


# ---- the text that Pinocchio reads ---------------------------------------------------------------


def pinocchio_text(urdf: Urdf, locked: Mapping[str, float]) -> str:
    """Write the URDF that Pinocchio is to read: kinematics and inertias, no shapes.

    Continuous joints become revolute, so that nq == nv. Locked joints become fixed ones: unlike
    ``pinocchio.buildReducedModel`` this also works when a joint and a link share a name, and it
    gives the same model.

    Args:
        urdf: a robot without problems.
        locked: joints held fixed, and their positions [rad or m].
    """
    root = Element("robot", name=urdf.name)
    for link in urdf.links:
        element = SubElement(root, "link", name=link.name)
        if link.inertial is not None:
            _write_inertial(element, link.inertial)
    for joint in urdf.joints:
        _write_joint(root, joint, locked)
    return tostring(root, encoding="unicode")


def _write_inertial(link: Element, inertial: Inertial) -> None:
    element = SubElement(link, "inertial")
    SubElement(element, "origin", xyz=_words(inertial.com), rpy=_words(inertial.rpy))
    SubElement(element, "mass", value=_words([inertial.mass]))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertial.inertia.tolist()
    values = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    SubElement(element, "inertia", {key: repr(value) for key, value in values.items()})


def _write_joint(root: Element, joint: Joint, locked: Mapping[str, float]) -> None:
    moves = joint.moves and joint.name not in locked
    kind = "fixed" if not moves else "revolute" if joint.kind == "continuous" else joint.kind
    element = SubElement(root, "joint", name=joint.name, type=kind)
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=joint.child)
    xyz, rpy = joint.xyz, joint.rpy
    if locked.get(joint.name, 0.0) != 0.0:
        pose = placement(joint, locked[joint.name])
        xyz, rpy = pose.translation, pin.rpy.matrixToRpy(pose.rotation)
    SubElement(element, "origin", xyz=_words(xyz), rpy=_words(rpy))
    if not moves:
        return
    SubElement(element, "axis", xyz=_words(joint.axis))
    limit = {
        "lower": max(joint.lower, -_FREE),
        "upper": min(joint.upper, _FREE),
        "effort": joint.effort,
        "velocity": joint.velocity,
    }
    SubElement(element, "limit", {key: repr(float(value)) for key, value in limit.items()})
    dynamics = {"damping": repr(joint.damping), "friction": repr(joint.friction)}
    SubElement(element, "dynamics", dynamics)


def _words(values: ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values))

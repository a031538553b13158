"""Reading a URDF: from XML to frozen records, with a note of everything that cannot be read.

Nothing here judges physics (``validate`` does) and nothing here knows Pinocchio, whose own reader
crashes on some broken files and quietly replaces unreadable numbers by zero.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from xml.etree import ElementTree

import numpy as np

from arm3dof.errors import Problem
from arm3dof.model import urdf_shapes
from arm3dof.model.urdf_numbers import NumberReader
from arm3dof.state import Array

MOVING_KINDS = ("revolute", "prismatic", "continuous")
"""Joint types with one degree of freedom."""

_UNSUPPORTED_KINDS = ("floating", "planar")
_MAX_DEPTH = 50
_UNUSED_IN_JOINT = ("safety_controller", "calibration")
_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass properties of one link as the file states them; NaN where a number is unreadable.

    Attributes:
        mass: [kg].
        com: centre of mass in the link frame, shape (3,) [m].
        rpy: orientation of the inertia's axes in the link frame, shape (3,) [rad].
        inertia: inertia about the centre of mass, along those axes, shape (3, 3) [kg m^2].
    """

    mass: float
    com: Array
    rpy: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class Link:
    """One link; ``inertial`` is None where the file gives none."""

    name: str
    inertial: Inertial | None


@dataclass(frozen=True)
class Mimic:
    """How a joint follows another one: its position is ``multiplier * q + offset``.

    Attributes:
        joint: name of the joint that is followed.
        multiplier: how far it goes for each unit of the other.
        offset: its position where the other is at 0 [rad or m].
    """

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint; a limit or a number that is missing or unreadable is NaN.

    Attributes:
        name: the joint's name.
        kind: URDF type, for example ``revolute``.
        parent: name of the link that it hangs on; empty if the file names none.
        child: name of the link that it carries; empty if the file names none.
        xyz: its place in the parent link's frame, shape (3,) [m].
        rpy: its orientation there, shape (3,) [rad].
        axis: axis in the joint's own frame, shape (3,).
        lower: lowest position [rad or m]; ``-inf`` for a continuous joint.
        upper: highest position [rad or m]; ``inf`` for a continuous joint.
        effort: highest torque or force [N m or N].
        velocity: highest speed [rad/s or m/s].
        damping: viscous friction [N m s/rad or N s/m].
        friction: Coulomb friction [N m or N].
        mimics: how this joint follows another one, if it does.
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Array
    rpy: Array
    axis: Array
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    friction: float
    mimics: Mimic | None

    @property
    def moves(self) -> bool:
        """Whether the joint has one degree of freedom."""
        return self.kind in MOVING_KINDS


@dataclass(frozen=True, eq=False)
class Urdf:
    """A URDF that was read.

    Attributes:
        name: the robot's name.
        links: all links, in document order.
        joints: all joints, in document order.
        text: the same robot as clean XML: links, joints and materials with tidy numbers. Left out
            are comments and elements that no arm needs here (gazebo, transmission,
            safety_controller, calibration).
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    text: str

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """Joints with one degree of freedom, in document order."""
        return tuple(joint for joint in self.joints if joint.moves)


@lru_cache(maxsize=8)
def read_urdf(source: str | bytes) -> tuple[Urdf | None, tuple[Problem, ...]]:
    """Read URDF text; the last few that were read are remembered.

    Args:
        source: the file's text or bytes.

    Returns:
        The robot, or None where the text is not a URDF at all, and all problems that reading
        found: broken XML with its line, missing names and attributes, numbers that are none,
        unknown joint types, geometry and materials that cannot be drawn.
    """
    root, problems = _parse(source)
    if root is None:
        return None, problems
    reader = NumberReader()
    name = root.get("name", "")
    if not name:
        reader.note("<robot>", "has no name", 'write <robot name="...">')
    _check_version(root, reader)
    links = tuple(_link(element, reader) for element in root.findall("link"))
    joints = tuple(_joint(element, reader) for element in root.findall("joint"))
    urdf_shapes.check_materials(root.findall("material"), reader)
    return Urdf(name, links, joints, _clean_text(root)), tuple(reader.problems)


# ---- XML ---------------------------------------------------------------------------------------


def _parse(source: str | bytes) -> tuple[ElementTree.Element | None, tuple[Problem, ...]]:
    try:
        root = ElementTree.fromstring(source)
    except ElementTree.ParseError as error:
        line, column = error.position
        reason = str(error).partition(":")[0]
        cure = "correct the XML there (an unclosed tag or quote, or two roots, are the usual cause)"
        return None, (Problem(f"line {line}, column {column + 1}", f"broken XML: {reason}", cure),)
    except (LookupError, ValueError) as error:
        return None, (Problem("the file", f"unreadable text: {error}", "save it as UTF-8"),)
    problem = _not_a_urdf(root)
    if problem is not None:
        return None, (problem,)
    _drop_default_namespace(root)
    return root, ()


def _not_a_urdf(root: ElementTree.Element) -> Problem | None:
    if root.tag.rpartition("}")[2] != "robot":
        cure = "give a URDF file, whose outermost element is <robot>"
        return Problem(f"<{root.tag}>", "not a URDF", cure)
    if any("xacro" in element.tag for element in root.iter()):
        cure = "expand it first: xacro robot.urdf.xacro > robot.urdf"
        return Problem("<robot>", "a xacro file that has not been expanded", cure)
    level, depth = [root], 0
    while level and depth <= _MAX_DEPTH:
        level, depth = [child for element in level for child in element], depth + 1
    if level:
        return Problem("<robot>", f"elements are nested deeper than {_MAX_DEPTH}", "flatten them")
    return None


def _drop_default_namespace(root: ElementTree.Element) -> None:
    prefix = root.tag[: -len("robot")]
    for element in root.iter():
        element.tag = element.tag.removeprefix(prefix)


def _check_version(root: ElementTree.Element, reader: NumberReader) -> None:
    version = root.get("version", "1.0")
    if not re.fullmatch(r"1(\.[0-2])?", version):
        what = f'URDF version "{version}" is unknown'
        reader.note("<robot>", what, 'write version="1.0" or leave it out')


def _clean_text(root: ElementTree.Element) -> str:
    clean = ElementTree.Element("robot", {"name": root.get("name", "")})
    for element in root:
        if element.tag not in ("link", "joint", "material"):
            continue
        clean.append(element)
        for unused in [child for child in element if child.tag in _UNUSED_IN_JOINT]:
            element.remove(unused)
        for dynamics in element.findall("dynamics"):
            if "damping" not in dynamics.attrib and "friction" not in dynamics.attrib:
                element.remove(dynamics)  # urdfdom refuses a <dynamics> that says nothing
    return ElementTree.tostring(clean, encoding="unicode")


# ---- links and joints --------------------------------------------------------------------------


def _name(element: ElementTree.Element, reader: NumberReader) -> str:
    name = element.get("name", "")
    if not name:
        reader.note(f"<{element.tag}>", "has no name", "give every link and joint a name")
    return name


def _check_once(
    element: ElementTree.Element, children: Iterable[str], where: str, reader: NumberReader
) -> None:
    for tag in children:
        count = len(element.findall(tag))
        if count > 1:
            reader.note(where, f"has {count} <{tag}> elements", "keep one")


def _link(element: ElementTree.Element, reader: NumberReader) -> Link:
    name = _name(element, reader)
    where = f"link '{name}'"
    _check_once(element, _ONCE["link"], where, reader)
    inertial = element.find("inertial")
    urdf_shapes.check_shapes(element, where, reader)
    return Link(name, None if inertial is None else _inertial(inertial, where, reader))


def _inertial(element: ElementTree.Element, where: str, reader: NumberReader) -> Inertial:
    _check_once(element, _ONCE["inertial"], where, reader)
    com, rpy = reader.origin(element, where)
    mass = reader.number(element.find("mass"), "value", where, "mass")
    tensor = element.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        reader.number(tensor, key, where, "inertia")
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia.flags.writeable = False
    return Inertial(mass, com, rpy, inertia)


def _joint(element: ElementTree.Element, reader: NumberReader) -> Joint:
    name = _name(element, reader)
    where = f"joint '{name}'"
    _check_once(element, _ONCE["joint"], where, reader)
    kind = _kind(element, where, reader)
    xyz, rpy = reader.origin(element, where)
    limit, dynamics, mimic = (element.find(tag) for tag in ("limit", "dynamics", "mimic"))
    lower, upper = (reader.optional(limit, key, where, 0.0) for key in ("lower", "upper"))
    if kind == "continuous":
        lower, upper = -np.inf, np.inf
    return Joint(
        name=name,
        kind=kind,
        parent=_end(element, "parent"),
        child=_end(element, "child"),
        xyz=xyz,
        rpy=rpy,
        axis=reader.vector(element.find("axis"), "xyz", where, (1.0, 0.0, 0.0)),
        lower=lower,
        upper=upper,
        effort=reader.optional(limit, "effort", where, np.nan),
        velocity=reader.optional(limit, "velocity", where, np.nan),
        damping=reader.optional(dynamics, "damping", where, 0.0),
        friction=reader.optional(dynamics, "friction", where, 0.0),
        mimics=None if mimic is None else _mimic(mimic, where, reader),
    )


def _mimic(element: ElementTree.Element, where: str, reader: NumberReader) -> Mimic:
    return Mimic(
        element.get("joint", "another joint"),
        reader.optional(element, "multiplier", where, 1.0),
        reader.optional(element, "offset", where, 0.0),
    )


def _kind(element: ElementTree.Element, where: str, reader: NumberReader) -> str:
    kind = element.get("type", "")
    if kind in _UNSUPPORTED_KINDS:
        cure = "make it fixed, or replace it by revolute and prismatic joints"
        reader.note(where, f"type '{kind}' has more than one degree of freedom", cure)
    elif kind not in (*MOVING_KINDS, "fixed"):
        what = f"type '{kind}' is unknown" if kind else "has no type"
        reader.note(where, what, f"use one of: fixed, {', '.join(MOVING_KINDS)}")
    return kind


def _end(element: ElementTree.Element, tag: str) -> str:
    end = element.find(tag)
    return "" if end is None else end.get("link", "")

"""Changing a URDF's parameters by name before it is loaded.

==================================  ================================================  ============
key                                 meaning                                           unit
==================================  ================================================  ============
``LINK.mass``                       mass                                              kg
``LINK.com.x`` ``.y`` ``.z``        centre of mass in the link's frame                m
``LINK.inertia.ixx`` ... ``.izz``   inertia about the centre of mass, in the axes of  kg m^2
                                    the link's ``<inertial>``
``LINK.length``                     distance from the link's frame to the next        m
                                    joint on the way to the tool, or to the tool
``JOINT.effort``                    highest torque or force                           N m or N
``JOINT.velocity``                  highest speed                                     rad/s or m/s
``JOINT.lower`` ``JOINT.upper``     range                                             rad or m
``JOINT.damping``                   viscous friction                                  N m s/rad
``JOINT.friction``                  Coulomb friction                                  N m
``gravity.x`` ``.y`` ``.z``         gravity in the base frame                         m/s^2
==================================  ================================================  ============

A new length scales the origin of the next joint (or of the tool) along its direction, and those of
fixed links in between. Mass, centre of mass, inertia and shapes stay as they are, in the link's own
frame: they are what is attached to the joint, and each has a key of its own. A link without a
length key ends where it begins, or does not lead to the tool.

A link without ``<inertial>`` takes a mass as well: ``tool.mass`` is a point of payload at the tool.
"""

from __future__ import annotations

import difflib
import io
from collections import defaultdict
from collections.abc import Mapping
from numbers import Real
from typing import Any
from xml.etree import ElementTree

import numpy as np

from arm3dof.errors import InputError
from arm3dof.model.robot import STANDARD_GRAVITY
from arm3dof.model.tree import chain_to, placement, root_link
from arm3dof.model.urdf import Inertial, Urdf
from arm3dof.model.urdf_numbers import LARGEST

_AXES = ("x", "y", "z")
_INERTIA = {
    "ixx": (0, 0),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyy": (1, 1),
    "iyz": (1, 2),
    "izz": (2, 2),
}
_LINK_FIELDS = (
    "mass",
    *(f"com.{axis}" for axis in _AXES),
    *(f"inertia.{entry}" for entry in _INERTIA),
)
_FREE_FIELDS = ("effort", "velocity", "damping", "friction")
_JOINT_FIELDS = (*_FREE_FIELDS, "lower", "upper")
_POSITIVE = ("length", "effort", "velocity")
_NOT_NEGATIVE = ("mass", "damping", "friction")

_Key = tuple[str, str, str]  # kind ("link", "joint" or "gravity"), name, field


def override_keys(urdf: Urdf, tool_link: str) -> tuple[str, ...]:
    """Return every key that a robot's overrides may have.

    Args:
        urdf: a robot whose links form a tree.
        tool_link: the link that is brought to targets; lengths lead to it.
    """
    return tuple(_keys(urdf, tool_link))


def override_values(urdf: Urdf, tool_link: str) -> dict[str, float]:
    """Return the present value of every key that a robot's overrides may have, in SI units.

    Args:
        urdf: a robot whose links form a tree.
        tool_link: the link that is brought to targets; lengths lead to it.
    """
    links = {link.name: link.inertial for link in urdf.links}
    joints = {joint.name: joint for joint in urdf.joints}
    segments = _segments(urdf, tool_link)
    values = {}
    for key, (kind, name, field) in _keys(urdf, tool_link).items():
        if kind == "gravity":
            values[key] = STANDARD_GRAVITY[_AXES.index(field)]
        elif kind == "joint":
            values[key] = float(getattr(joints[name], field))
        elif field == "length":
            values[key] = _length(urdf, segments[name])
        else:
            values[key] = _inertial_value(links[name], field)
    return values


def apply_overrides(
    urdf: Urdf, overrides: Mapping[str, float], tool_link: str
) -> tuple[str, tuple[float, ...]]:
    """Change a URDF's parameters.

    yourdfpy edits and writes the file. The result is to be validated again: two values that are
    each possible (an inertia, a limit) may not go together.

    Args:
        urdf: a robot whose links form a tree.
        overrides: new values by key, SI units.
        tool_link: the link that is brought to targets; lengths lead to it.

    Returns:
        The new URDF text, and gravity in the base frame [m/s^2].

    Raises:
        InputError: a key is unknown, a value is impossible, or a value would have no effect.
    """
    keys = _keys(urdf, tool_link)
    chosen = {_known(key, keys): _checked(key, value) for key, value in overrides.items()}
    gravity = list(STANDARD_GRAVITY)
    file = _open(urdf.text)
    links = {link.name: link for link in file.robot.links}
    joints = {joint.name: joint for joint in file.robot.joints}
    for (kind, name, field), value in chosen.items():
        if kind == "gravity":
            gravity[_AXES.index(field)] = value
        elif field == "length":
            segment = _segments(urdf, tool_link)[name]
            scale = value / _length(urdf, segment)
            for joint in segment:
                if joints[joint].origin is not None:
                    joints[joint].origin[:3, 3] *= scale
        elif kind == "link":
            _edit_link(links[name], field, value)
        else:
            _edit_joint(joints[name], field, value)
    for kind, name, field in chosen:
        if kind == "link" and field not in ("mass", "length") and not links[name].inertial.mass:
            raise InputError(
                f"override '{name}.{field}' has no effect: link '{name}' has no mass; "
                f"set '{name}.mass' as well"
            )
    return _with_mimics(file.write_xml_string(), urdf), tuple(gravity)


# ---- keys and values ---------------------------------------------------------------------------


def _keys(urdf: Urdf, tool_link: str) -> dict[str, _Key]:
    keys: list[_Key] = []
    segments = _segments(urdf, tool_link)
    for link in urdf.links:
        keys += [("link", link.name, field) for field in _LINK_FIELDS]
        if _length(urdf, segments.get(link.name, ())) > 1e-9:
            keys.append(("link", link.name, "length"))
    for joint in urdf.moving_joints:
        fields = _FREE_FIELDS if joint.kind == "continuous" else _JOINT_FIELDS
        keys += [("joint", joint.name, field) for field in fields]
    keys += [("gravity", "gravity", axis) for axis in _AXES]
    return {f"{name}.{field}": (kind, name, field) for kind, name, field in keys}


def _known(key: str, keys: Mapping[str, _Key]) -> _Key:
    if key in keys:
        return keys[key]
    close = difflib.get_close_matches(str(key), keys, n=1)
    guess = f"; did you mean '{close[0]}'?" if close else ";"
    raise InputError(f"unknown override '{key}'{guess} there are: {_summary(keys)}")


def _summary(keys: Mapping[str, _Key]) -> str:
    """Return the keys with names that take the same fields put together."""
    fields: dict[str, list[str]] = defaultdict(list)
    for kind, name, field in keys.values():
        fields[f"{kind} {name}"].append(field)
    names: dict[str, list[str]] = defaultdict(list)
    for owner, taken in fields.items():
        names[", ".join(taken)].append(owner.partition(" ")[2])
    return "; ".join(f"{'|'.join(owners)} . {taken}" for taken, owners in names.items())


def _checked(key: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not abs(float(value)) <= LARGEST:
        raise InputError(f"override '{key}' is {value!r}; give a finite number in SI units")
    field = key.rpartition(".")[2]
    if field in _POSITIVE and not value > 0:
        raise InputError(f"override '{key}' is {value!r}; give a number above 0")
    if field in _NOT_NEGATIVE and value < 0:
        raise InputError(f"override '{key}' is {value!r}; give 0 or more")
    return float(value)


# ---- lengths -----------------------------------------------------------------------------------


def _segments(urdf: Urdf, tool_link: str) -> dict[str, tuple[str, ...]]:
    """Return, for the base and each link that a joint moves, the joints up to the next such link.

    Only links on the way to the tool appear; the last one's joints lead to the tool itself.
    """
    segments: dict[str, tuple[str, ...]] = {}
    start, names = root_link(urdf), []
    for joint in chain_to(urdf, tool_link):
        names.append(joint.name)
        if joint.moves:
            segments[start] = tuple(names)
            start, names = joint.child, []
    segments[start] = tuple(names)
    return segments


def _length(urdf: Urdf, segment: tuple[str, ...]) -> float:
    joints = {joint.name: joint for joint in urdf.joints}
    point = np.zeros(3)
    for name in reversed(segment):
        point = placement(joints[name], 0.0).act(point)
    return float(np.linalg.norm(point))


def _inertial_value(inertial: Inertial | None, field: str) -> float:
    if inertial is None:
        return 0.0
    if field == "mass":
        return inertial.mass
    kind, _, entry = field.partition(".")
    if kind == "com":
        return float(inertial.com[_AXES.index(entry)])
    return float(inertial.inertia[_INERTIA[entry]])


# ---- editing -----------------------------------------------------------------------------------


def _open(text: str) -> Any:
    from yourdfpy import URDF  # over a second to import, and only overrides need it

    return URDF.load(
        io.BytesIO(text.encode()),
        build_scene_graph=False,
        load_meshes=False,
        filename_handler=str,
    )


def _with_mimics(text: bytes, urdf: Urdf) -> str:
    """Put back which joints follow others: yourdfpy does not write that."""
    root = ElementTree.fromstring(text)
    for joint in urdf.joints:
        if joint.mimics is not None:
            element = root.find(f"joint[@name='{joint.name}']")
            if element is not None and element.find("mimic") is None:
                values = {key: str(value) for key, value in vars(joint.mimics).items()}
                ElementTree.SubElement(element, "mimic", values)
    return ElementTree.tostring(root, encoding="unicode")


def _edit_link(link: Any, field: str, value: float) -> None:
    from yourdfpy import Inertial

    if link.inertial is None:
        link.inertial = Inertial(mass=0.0, inertia=np.zeros((3, 3)))
    inertial = link.inertial
    kind, _, entry = field.partition(".")
    if kind == "mass":
        inertial.mass = value
    elif kind == "com":
        if inertial.origin is None:
            inertial.origin = np.eye(4)
        inertial.origin[_AXES.index(entry), 3] = value
    else:
        row, column = _INERTIA[entry]
        inertial.inertia[row, column] = inertial.inertia[column, row] = value


def _edit_joint(joint: Any, field: str, value: float) -> None:
    from yourdfpy import Dynamics, Limit

    if field in ("damping", "friction"):
        if joint.dynamics is None:
            joint.dynamics = Dynamics()
        setattr(joint.dynamics, field, value)
        return
    if joint.limit is None:
        joint.limit = Limit()
    setattr(joint.limit, field, value)

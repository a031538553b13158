"""Write urdf/arm3dof.urdf from the parts of the arm: their shapes, places and densities.

Every part (``arm_parts.py``) is a box or a cylinder of stated size and material; masses, centroids
and inertia tensors are the exact sums over the parts by the parallel-axis theorem.

Link frames are the frames of the paper's modified DH table (Table I), so that ``base_link``,
``link1``, ``link2``, ``link3`` and ``tool`` are its frames 0 to 4:

- base_link, link1: origin at the shoulder, x forward, y left, z up;
- link2, link3: origin on the joint's axis, x along the link, y up, z to the arm's right;
- tool: the point between the fingers;
- right_finger, left_finger: the middle of the pad's face, along link3's axes. Both joints are 0
  where the gripper is open, and close it as they grow.

Run ``python tools/make_arm_urdf.py`` to write the file, ``--check`` to see whether the file in
the repository is what this script writes.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from arm_parts import A2, A3, COLLISIONS, LINKS, OPENING, PINION_RADIUS
from arm_shapes import Box, Cylinder, Part, Vec, sum_parts, vec

URDF = Path(__file__).resolve().parents[1] / "urdf" / "arm3dof.urdf"

EFFORT = 1.96  # N m: the DS3218's stall torque at 6.8 V, 20 kgf cm
SPEED = 7.5  # rad/s: its no-load speed, 0.14 s for 60 deg
DAMPING, FRICTION = 0.01, 0.0  # N m s/rad, N m
TRAVEL = math.radians(270.0)  # the servo's range

# The gripper's servo closes each finger by 33 mm in 236 deg. At stall its pinion could give 245 N,
# 122 N to each finger; its current is limited so that a finger presses with at most 10 N.
STROKE = OPENING / 2  # mm
GRIP = 10.0  # N: what one finger presses with
FINGER_SPEED = SPEED * PINION_RADIUS * 1e-3  # m/s
FINGER_DAMPING = 5.0  # N s/m, of one finger's guide


@dataclass(frozen=True)
class Joint:
    """A servo: where its frame sits in the parent's [mm, rad], and the middle of its travel."""

    name: str
    parent: str
    child: str
    at: Vec
    rpy: Vec
    middle: float


JOINTS = (
    Joint("joint1", "base_link", "link1", (0, 0, 0), (0, 0, 0), 0.0),
    # mounted so that the middle of its travel is the arm upright
    Joint("joint2", "link1", "link2", (0, 0, 0), (math.pi / 2, 0, 0), math.pi / 2),
    Joint("joint3", "link2", "link3", (A2, 0, 0), (0, 0, 0), 0.0),
)

# ---- writing -----------------------------------------------------------------------------------


def number(value: float, digits: int = 6) -> str:
    """Write a number with so many significant digits, and no negative zero."""
    return f"{value:.{digits}g}" if abs(value) > 1e-15 else "0"


def numbers(values: Iterable[float]) -> str:
    """Write numbers separated by blanks."""
    return " ".join(number(value) for value in values)


def origin(at: Vec, rpy: Vec = (0, 0, 0)) -> ET.Element:
    """Return an origin element; ``at`` in mm."""
    element = ET.Element("origin", xyz=numbers(value * 1e-3 for value in at))
    element.set("rpy", " ".join(number(angle, 17) for angle in rpy))
    return element


def shape_element(shape: Box | Cylinder) -> ET.Element:
    """Return the element of a shape."""
    if isinstance(shape, Box):
        return ET.Element("box", size=numbers(side * 1e-3 for side in shape.size))
    radius, length = number(shape.radius * 1e-3), number(shape.length * 1e-3)
    return ET.Element("cylinder", radius=radius, length=length)


def geometry(kind: str, shape: Box | Cylinder, at: Vec) -> ET.Element:
    """Return a visual or collision element."""
    turn = {"x": (0, math.pi / 2, 0), "y": (math.pi / 2, 0, 0), "z": (0, 0, 0)}
    element = ET.Element(kind)
    element.append(origin(at, turn[shape.axis] if isinstance(shape, Cylinder) else (0, 0, 0)))
    ET.SubElement(element, "geometry").append(shape_element(shape))
    return element


def link(name: str, parts: list[Part]) -> ET.Element:
    """Return a link with its inertia, what is seen and what collides."""
    body = sum_parts(parts)
    element = ET.Element("link", name=name)
    inertial = ET.SubElement(element, "inertial")
    inertial.append(origin(vec(body.centroid * 1e3)))
    ET.SubElement(inertial, "mass", value=number(body.mass))
    pairs = [(i, k) for i in range(3) for k in range(i, 3)]
    tensor = {"i" + "xyz"[i] + "xyz"[k]: number(body.tensor[i, k]) for i, k in pairs}
    ET.SubElement(inertial, "inertia", tensor)
    for part in (part for part in parts if part.drawn):
        visual = geometry("visual", part.shape, part.at)
        visual.set("name", part.name)
        ET.SubElement(visual, "material", name=part.material.name)
        element.append(visual)
    element.extend(geometry("collision", shape, at) for shape, at in COLLISIONS[name])
    return element


def joint(spec: Joint) -> ET.Element:
    """Return a revolute joint about its own z-axis."""
    element = ET.Element("joint", name=spec.name, type="revolute")
    element.append(origin(spec.at, spec.rpy))
    ET.SubElement(element, "parent", link=spec.parent)
    ET.SubElement(element, "child", link=spec.child)
    ET.SubElement(element, "axis", xyz="0 0 1")
    low, high = spec.middle - TRAVEL / 2, spec.middle + TRAVEL / 2
    limit = {"lower": low, "upper": high, "effort": EFFORT, "velocity": SPEED}
    ET.SubElement(element, "limit", {key: number(value, 17) for key, value in limit.items()})
    ET.SubElement(element, "dynamics", damping=number(DAMPING), friction=number(FRICTION))
    return element


def finger_joint(name: str, side: float, mimic: ET.Element | None) -> ET.Element:
    """Return the prismatic joint of a finger, which closes towards the other one.

    Args:
        name: of the joint.
        side: 1 for the right finger (z > 0), -1 for the left one.
        mimic: what couples it to the other finger's joint, if anything does.
    """
    element = ET.Element("joint", name=name, type="prismatic")
    element.append(origin((A3, 0, side * OPENING / 2)))
    ET.SubElement(element, "parent", link="link3")
    ET.SubElement(element, "child", link="right_finger" if side > 0 else "left_finger")
    ET.SubElement(element, "axis", xyz=numbers((0, 0, -side)))
    # the effort moves both fingers: the force at the pinion's rim
    limit = {"lower": 0.0, "upper": STROKE * 1e-3, "effort": 2 * GRIP, "velocity": FINGER_SPEED}
    ET.SubElement(element, "limit", {key: number(value) for key, value in limit.items()})
    ET.SubElement(element, "dynamics", damping=number(FINGER_DAMPING), friction="0")
    if mimic is not None:
        element.append(mimic)
    return element


def make_urdf() -> str:
    """Return the text of the URDF."""
    robot = ET.Element("robot", name="arm3dof")
    used = {part.material for parts in LINKS.values() for part in parts if part.drawn}
    for material in sorted(used, key=lambda m: m.name):
        element = ET.SubElement(robot, "material", name=material.name)
        ET.SubElement(element, "color", rgba=numbers((*material.rgb, 1.0)))
    robot.extend(link(name, parts) for name, parts in LINKS.items())
    ET.SubElement(robot, "link", name="tool")
    robot.extend(joint(spec) for spec in JOINTS)
    tool = ET.SubElement(robot, "joint", name="tool_joint", type="fixed")
    tool.append(origin((A3, 0, 0)))
    ET.SubElement(tool, "parent", link="link3")
    ET.SubElement(tool, "child", link="tool")
    follow = ET.Element("mimic", joint="gripper", multiplier="1")
    robot.append(finger_joint("gripper", 1.0, None))
    robot.append(finger_joint("left_finger_joint", -1.0, follow))
    ET.indent(robot)
    body = ET.tostring(robot, encoding="unicode")
    note = "<!-- Written by tools/make_arm_urdf.py from the parts' shapes and densities. -->"
    return f'<?xml version="1.0" encoding="utf-8"?>\n{note}\n{body}\n'


def main(arguments: list[str] | None = None) -> int:
    """Write the file, or with ``--check`` compare it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    text = make_urdf()
    if parser.parse_args(arguments).check:
        if URDF.is_file() and URDF.read_text(encoding="utf-8") == text:
            return 0
        print(f"{URDF}: not what {Path(__file__).name} writes; run it", file=sys.stderr)
        return 1
    URDF.write_text(text, encoding="utf-8")
    for name, parts in LINKS.items():
        body = sum_parts(parts)
        print(f"{name}: {body.mass * 1e3:.1f} g, centroid {np.round(body.centroid * 1e3, 2)} mm")
        print(np.round(body.tensor * 1e6, 3))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Write urdf/arm3dof.urdf from the parts of the arm: their shapes, places and densities.

The arm is four DS3218 servos, bent 2 mm aluminium brackets and printed parts. Every part is a box
or a cylinder of stated size (millimetres) and material; masses, centroids and inertia tensors are
the exact sums over the parts by the parallel-axis theorem. Nothing is tuned by hand.

Link frames are the frames of the paper's modified DH table (Table I), so that ``base_link``,
``link1``, ``link2``, ``link3`` and ``tool`` are its frames 0 to 4:

- base_link, link1: origin at the shoulder, x forward, y left, z up;
- link2, link3: origin on the joint's axis, x along the link, y up, z to the arm's right;
- tool: the point between the fingers.

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
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vec = tuple[float, float, float]

URDF = Path(__file__).resolve().parents[1] / "urdf" / "arm3dof.urdf"

A2, A3 = 105.0, 150.0  # mm: shoulder to elbow, elbow to the point between the fingers
TABLE = -110.0  # mm: height of the table in the shoulder's frame
OPENING = 50.0  # mm between the finger pads
EFFORT = 1.96  # N m: the DS3218's stall torque at 6.8 V, 20 kgf cm
SPEED = 7.5  # rad/s: its no-load speed, 0.14 s for 60 deg
DAMPING, FRICTION = 0.01, 0.0  # N m s/rad, N m
TRAVEL = math.radians(270.0)  # the servo's range
SERVO_MASS = 0.060  # kg

# ---- shapes ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Material:
    """What a part is made of: colour (red, green, blue, 0 to 1) and density [kg/m^3]."""

    name: str
    rgb: Vec
    density: float


ALUMINIUM = Material("aluminium", (0.78, 0.80, 0.82), 2700.0)
STEEL = Material("steel", (0.55, 0.57, 0.60), 7850.0)
PRINTED = Material("printed", (0.00, 0.36, 0.58), 900.0)  # PLA, 1240 kg/m^3, 70 % filled
RUBBER = Material("rubber", (0.16, 0.17, 0.18), 1150.0)
CABLE = Material("cable", (0.20, 0.20, 0.22), 2600.0)  # copper and PVC
BOARD = Material("board", (0.05, 0.30, 0.28), 1900.0)  # glass-fibre circuit board and parts
CASE = Material("servo_case", (0.11, 0.12, 0.13), 0.0)
HEATSINK = Material("servo_middle", (0.36, 0.38, 0.41), 0.0)
BRASS = Material("brass", (0.90, 0.62, 0.00), 0.0)


@dataclass(frozen=True)
class Box:
    """A box with edges along the frame's axes; sizes in mm."""

    size: Vec

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return math.prod(self.size) * 1e-9

    def inertia_per_mass(self) -> Array:
        """Principal moments about the centroid over the mass, shape (3,) [m^2]."""
        squares = (np.array(self.size) * 1e-3) ** 2
        return (squares.sum() - squares) / 12.0

    def element(self) -> ET.Element:
        """Return the URDF element."""
        return ET.Element("box", size=numbers(side * 1e-3 for side in self.size))


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder about one of the frame's axes; sizes in mm."""

    radius: float
    length: float
    axis: str = "z"

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return math.pi * self.radius**2 * self.length * 1e-9

    def inertia_per_mass(self) -> Array:
        """Principal moments about the centroid over the mass, shape (3,) [m^2]."""
        radius, length = self.radius * 1e-3, self.length * 1e-3
        moments = np.full(3, radius**2 / 4.0 + length**2 / 12.0)
        moments["xyz".index(self.axis)] = radius**2 / 2.0
        return moments

    def element(self) -> ET.Element:
        """Return the URDF element."""
        return ET.Element(
            "cylinder", radius=number(self.radius * 1e-3), length=number(self.length * 1e-3)
        )


@dataclass(frozen=True)
class Part:
    """A shape of one material at a place in its link's frame.

    Attributes:
        name: what it is.
        shape: its form; box edges and cylinder axes lie along the link's axes.
        at: place of its centre [mm].
        material: what it is made of.
        mass: mass [kg] if it is known from a data sheet; else density times volume.
        drawn: whether it is seen (a servo weighs as one box but is drawn as several).
    """

    name: str
    shape: Box | Cylinder
    at: Vec
    material: Material
    mass: float | None = None
    drawn: bool = True

    @property
    def weight(self) -> float:
        """Mass [kg]."""
        return self.material.density * self.shape.volume if self.mass is None else self.mass


@dataclass(frozen=True)
class Body:
    """Inertia of a link: mass [kg], centroid (3,) [m], tensor (3, 3) about it [kg m^2]."""

    mass: float
    centroid: Array
    tensor: Array


def sum_parts(parts: Iterable[Part]) -> Body:
    """Add parts up to one rigid body by the parallel-axis theorem."""
    parts = tuple(parts)
    masses = np.array([part.weight for part in parts])
    places = np.array([part.at for part in parts]) * 1e-3
    mass = float(masses.sum())
    centroid = masses @ places / mass
    tensor = np.zeros((3, 3))
    for part, m, r in zip(parts, masses, places - centroid, strict=True):
        tensor += m * (np.diag(part.shape.inertia_per_mass()) + (r @ r) * np.eye(3))
        tensor -= m * np.outer(r, r)
    return Body(mass, centroid, tensor)


def vec(values: Array) -> Vec:
    """Return three plain floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


# ---- assemblies --------------------------------------------------------------------------------


def servo(name: str, at: Vec, output: Vec, tail: Vec) -> list[Part]:
    """Return a DS3218: 40 x 20 x 40.5 mm and 60 g, which weighs as one box of even density.

    Args:
        name: which servo.
        at: the point of the output axis at half the case's height [mm].
        output: unit vector out of the case along the output axis.
        tail: unit vector from the output axis, which lies 10 mm from one end, to the far end.
    """
    out, far = np.array(output), np.array(tail)
    middle = np.array(at) + 10.0 * far

    def block(label: str, low: float, high: float, size: tuple[float, float], m: Material) -> Part:
        edges = np.abs(out) * (high - low) + np.abs(far) * size[0]
        edges = edges + np.abs(np.cross(out, far)) * size[1]
        return Part(f"{name}_{label}", Box(vec(edges)), vec(middle + out * (low + high) / 2), m)

    axis = "xyz"[int(np.argmax(np.abs(out)))]
    boss = Cylinder(6.5, 2.5, axis)
    return [
        Part(name, block("", -20.25, 20.25, (40.0, 20.0), CASE).shape, vec(middle), CASE,
             mass=SERVO_MASS, drawn=False),
        block("bottom", -20.25, -11.0, (40.0, 20.0), CASE),
        block("middle", -11.0, 5.5, (40.4, 20.4), HEATSINK),
        block("ears", 5.5, 8.5, (54.5, 20.0), CASE),
        block("gearbox", 8.5, 18.0, (40.0, 20.0), CASE),
        Part(f"{name}_boss", boss, vec(np.array(at) + out * 19.0), BRASS),
    ]  # fmt: skip


def fork(name: str) -> list[Part]:
    """Return the bent bracket that a servo turns, with horn and idler bearing, in links 2 and 3.

    It spans the servo (z = -20.25 to 20.25 mm) and carries the link on its web at x = 37 mm.
    """
    return [
        Part(f"{name}_horn_arm", Box((49.0, 22.0, 2.0)), (12.5, 0, 26), ALUMINIUM),
        Part(f"{name}_idler_arm", Box((49.0, 22.0, 2.0)), (12.5, 0, -26), ALUMINIUM),
        Part(f"{name}_web", Box((2.0, 22.0, 50.0)), (36, 0, 0), ALUMINIUM),
        Part(f"{name}_horn", Cylinder(10.0, 4.75), (0, 0, 22.625), ALUMINIUM),
        Part(f"{name}_horn_screw", Cylinder(3.0, 2.5), (0, 0, 28.25), STEEL),
        Part(f"{name}_idler", Cylinder(5.0, 4.75), (0, 0, -22.625), STEEL),
        Part(f"{name}_idler_nut", Cylinder(3.5, 3.0), (0, 0, -28.5), STEEL),
    ]


def base() -> list[Part]:
    """Return the pedestal: plate, feet, round housing, base servo and the servos' driver board."""
    feet = [
        Part(f"foot_{i}", Cylinder(8.0, 6.0), (x, y, TABLE + 3.0), RUBBER)
        for i, (x, y) in enumerate([(52, 52), (-52, 52), (-52, -52), (52, -52)])
    ]
    return [
        *feet,
        Part("base_plate", Box((130.0, 130.0, 4.0)), (0, 0, TABLE + 8.0), ALUMINIUM),
        Part("housing", Cylinder(41.0, 46.0), (0, 0, -77.0), PRINTED, mass=0.060),
        Part("housing_collar", Cylinder(44.0, 5.0), (0, 0, -97.5), PRINTED),
        Part("bearing_ring", Cylinder(37.0, 2.0), (0, 0, -53.0), STEEL, mass=0.030),
        Part("base_servo", Box((40.0, 20.0, 40.5)), (-10, 0, -75.0), CASE,
             mass=SERVO_MASS, drawn=False),
        Part("driver_board", Box((26.0, 62.0, 1.6)), (-51, 8, -97.0), BOARD),
        Part("driver_plugs", Box((8.0, 44.0, 9.0)), (-56, 8, -92.0), RUBBER),
    ]  # fmt: skip


def turret() -> list[Part]:
    """Return link 1: turntable and the cradle that holds the shoulder servo upright."""
    return [
        Part("turntable", Cylinder(36.0, 8.0), (0, 0, -48.0), PRINTED),
        Part("cradle_floor", Box((44.0, 50.0, 2.0)), (0, 0, -43.0), ALUMINIUM),
        Part("cradle_front", Box((2.0, 34.0, 38.0)), (11.4, 2, -23.0), ALUMINIUM),
        Part("cradle_back", Box((2.0, 34.0, 38.0)), (-11.4, 2, -23.0), ALUMINIUM),
        Part("cable_clip", Box((14.0, 10.0, 12.0)), (-20, 14, -36.0), PRINTED),
        *servo("shoulder_servo", (0, 0, 0), output=(0, -1, 0), tail=(0, 0, -1)),
    ]


def upper_arm() -> list[Part]:
    """Return link 2: fork, beam and the cradle that holds the elbow servo at its end."""
    x = A2 - 30.0  # rear face of the elbow servo
    return [
        *fork("shoulder_fork"),
        Part("beam", Box((x - 11.0 - 37.0, 20.0, 30.0)), ((x - 11.0 + 37.0) / 2, 0, 0), PRINTED),
        Part("elbow_cradle_back", Box((2.0, 26.0, 42.0)), (x - 10.0, 0, 0), ALUMINIUM),
        Part("elbow_cradle_top", Box((38.0, 2.0, 34.0)), (x + 10.0, 11.4, -3), ALUMINIUM),
        Part("elbow_cradle_bottom", Box((38.0, 2.0, 34.0)), (x + 10.0, -11.4, -3), ALUMINIUM),
        Part("cable", Cylinder(3.0, 68.0, "x"), (60, 15.5, -10), CABLE),
        Part("cable_tie", Box((6.0, 10.0, 9.0)), (52, 14, -10), PRINTED),
        *servo("elbow_servo", (A2, 0, 0), output=(0, 0, 1), tail=(-1, 0, 0)),
    ]


def forearm() -> list[Part]:
    """Return link 3 without the gripper's fingers: fork, gripper servo, palm, racks and rods."""
    return [
        *fork("elbow_fork"),
        Part("servo_tray", Box((46.0, 2.0, 52.0)), (59, -11.4, -4), ALUMINIUM),
        Part("tray_flange", Box((2.0, 24.0, 44.0)), (38, 0, -4), ALUMINIUM),
        *servo("gripper_servo", (60.25, 0, 0), output=(1, 0, 0), tail=(0, 0, -1)),
        Part("palm", Box((3.0, 38.0, 104.0)), (83.5, 0, 0), ALUMINIUM),
        Part("pinion", Cylinder(7.0, 6.0, "x"), (88.0, 0, 0), ALUMINIUM),
        Part("rack_right", Box((6.0, 4.0, 56.0)), (88.0, 9.0, 20), PRINTED),
        Part("rack_left", Box((6.0, 4.0, 56.0)), (88.0, -9.0, -20), PRINTED),
        Part("guide_rod_top", Cylinder(2.0, 104.0), (92.5, 15, 0), STEEL),
        Part("guide_rod_bottom", Cylinder(2.0, 104.0), (92.5, -15, 0), STEEL),
        Part("forearm_cable", Cylinder(2.0, 44.0, "x"), (58, 13, -20), CABLE),
    ]


def finger(name: str, side: float) -> list[Part]:
    """Return one finger; ``side`` is 1 for the right one (z > 0), -1 for the left one."""
    z = side * (OPENING / 2 + 3.0)
    return [
        Part(f"{name}_carriage", Box((12.0, 38.0, 14.0)), (93.0, 0, z + side * 5.0), PRINTED),
        Part(f"{name}", Box((66.0, 16.0, 4.0)), (132.0, 0, z + side * 2.0), ALUMINIUM),
        Part(f"{name}_pad", Box((32.0, 18.0, 3.0)), (A3, 0, z - side * 1.5), RUBBER),
    ]


LINKS: dict[str, list[Part]] = {
    "base_link": base(),
    "link1": turret(),
    "link2": upper_arm(),
    "link3": [*forearm(), *finger("right_finger", 1.0), *finger("left_finger", -1.0)],
}

COLLISIONS: dict[str, list[tuple[Box | Cylinder, Vec]]] = {
    "base_link": [
        (Box((130.0, 130.0, 10.0)), (0, 0, TABLE + 5.0)),
        (Cylinder(44.0, 48.0), (0, 0, -76.0)),
    ],
    "link1": [(Cylinder(36.0, 10.0), (0, 0, -47.0)), (Box((26.0, 42.0, 59.0)), (0, 0, -12.5))],
    "link2": [(Box((76.0, 24.0, 60.0)), (26.0, 0, 0)), (Box((60.0, 32.0, 44.0)), (92.0, 2, 0))],
    "link3": [
        (Box((50.0, 24.0, 60.0)), (13.0, 0, 0)),
        (Box((61.0, 38.0, 104.0)), (68.5, 0, 0)),
        (Box((66.0, 18.0, 7.0)), (132.0, 0, 28.5)),
        (Box((66.0, 18.0, 7.0)), (132.0, 0, -28.5)),
    ],
}


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


def geometry(kind: str, shape: Box | Cylinder, at: Vec) -> ET.Element:
    """Return a visual or collision element."""
    turn = {"x": (0, math.pi / 2, 0), "y": (math.pi / 2, 0, 0), "z": (0, 0, 0)}
    element = ET.Element(kind)
    element.append(origin(at, turn[shape.axis] if isinstance(shape, Cylinder) else (0, 0, 0)))
    ET.SubElement(element, "geometry").append(shape.element())
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

"""The parts of the reference arm: four DS3218 servos, bent brackets and printed parts.

Places are millimetres in the frame of the part's link. Aluminium brackets are 2 mm thick; bores
and slots are not taken out.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from arm_shapes import Box, Cylinder, Material, Part, Vec, vec

A2, A3 = 105.0, 150.0  # mm: shoulder to elbow, elbow to the point between the fingers
TABLE = -110.0  # mm: height of the table in the shoulder's frame
OPENING = 66.0  # mm between the finger pads of the open gripper: a 40 mm cube across its corners
PINION_RADIUS = 8.0  # mm: the gripper servo drives both fingers' racks by one pinion
SERVO_MASS = 0.060  # kg

ALUMINIUM = Material("aluminium", (0.76, 0.78, 0.81), 2700.0)
STEEL = Material("steel", (0.50, 0.53, 0.57), 7850.0)
BLUE = Material("printed_blue", (0.06, 0.47, 0.73), 900.0)  # PLA, 1240 kg/m^3, 70 % filled
DARK = Material("printed_dark", (0.20, 0.23, 0.27), 900.0)
RUBBER = Material("rubber", (0.10, 0.11, 0.12), 1150.0)
CABLE = Material("cable", (0.13, 0.13, 0.15), 2600.0)  # copper and PVC
BOARD = Material("board", (0.02, 0.33, 0.31), 1900.0)  # glass fibre and components
# what a servo is drawn with: its weight is that of the whole
CASE = Material("servo_case", (0.14, 0.15, 0.17), 0.0)
MIDDLE = Material("servo_middle", (0.42, 0.45, 0.48), 0.0)
BRASS = Material("brass", (0.93, 0.69, 0.13), 0.0)
LABEL = Material("servo_label", (0.95, 0.95, 0.93), 0.0)


def servo(name: str, at: Vec, output: Vec, tail: Vec) -> list[Part]:
    """Return a DS3218: 40 x 20 x 40.5 mm and 60 g, which weighs as one box of even density.

    Args:
        name: which servo.
        at: the point of the output axis at half the case's height [mm].
        output: unit vector out of the case along the output axis.
        tail: unit vector from the output axis, which lies 10 mm from one end, to the far end.
    """
    out, far = np.array(output), np.array(tail)
    side = np.cross(out, far)
    middle = np.array(at) + 10.0 * far
    axis = "xyz"[int(np.argmax(np.abs(out)))]

    def block(low: float, high: float, length: float, width: float) -> tuple[Box, Vec]:
        edges = np.abs(out) * (high - low) + np.abs(far) * length + np.abs(side) * width
        return Box(vec(edges)), vec(middle + out * (low + high) / 2)

    screws = [
        Part(f"{name}_screw_{i}", Cylinder(2.2, 1.6, axis),
             vec(middle + out * 9.3 + far * x + side * y), BRASS)
        for i, (x, y) in enumerate(product((-24.6, 24.6), (-5.0, 5.0)))
    ]  # fmt: skip
    return [
        Part(name, *block(-20.25, 20.25, 40.0, 20.0), CASE, mass=SERVO_MASS, drawn=False),
        Part(f"{name}_bottom", *block(-20.25, -11.0, 40.0, 20.0), CASE),
        Part(f"{name}_middle", *block(-11.0, 5.5, 40.5, 20.5), MIDDLE),
        Part(f"{name}_label", *block(-8.0, 3.0, 24.0, 20.7), LABEL),
        Part(f"{name}_ears", *block(5.5, 8.5, 54.5, 20.0), CASE),
        Part(f"{name}_gearbox", *block(8.5, 18.0, 40.0, 20.0), CASE),
        Part(f"{name}_boss", Cylinder(6.5, 2.5, axis), vec(np.array(at) + out * 19.0), BRASS),
        *screws,
    ]


def cable(
    name: str, radius: float, x: tuple[float, float], y: float, z: float, floor: float
) -> list[Part]:
    """Return a cable along a link, at height ``y``, that goes down to ``floor`` at both ends."""
    drop = Cylinder(radius, y - floor, "y")
    return [
        Part(f"{name}_start", drop, (x[0], (y + floor) / 2, z), CABLE),
        Part(name, Cylinder(radius, x[1] - x[0] + 2 * radius, "x"), (sum(x) / 2, y, z), CABLE),
        Part(f"{name}_end", drop, (x[1], (y + floor) / 2, z), CABLE),
    ]


def fork(name: str) -> list[Part]:
    """Return the bent bracket that a servo turns, with horn and idler bearing, in links 2 and 3.

    It spans the servo (z = -20.25 to 20.25 mm) and carries the link on its web at x = 37 mm.
    """
    bolts = [
        Part(f"{name}_bolt_{i}", Cylinder(1.6, 1.4), (x, y, 29.7), STEEL)
        for i, (x, y) in enumerate(((7.5, 0), (0, 7.5), (-7.5, 0), (0, -7.5)))
    ]
    return [
        Part(f"{name}_horn_arm", Box((43.0, 22.0, 2.0)), (15.5, 0, 26), ALUMINIUM),
        Part(f"{name}_idler_arm", Box((43.0, 22.0, 2.0)), (15.5, 0, -26), ALUMINIUM),
        Part(f"{name}_web", Box((2.0, 22.0, 50.0)), (36, 0, 0), ALUMINIUM),
        Part(f"{name}_horn", Cylinder(10.0, 4.75), (0, 0, 22.625), ALUMINIUM),
        Part(f"{name}_horn_cap", Cylinder(12.6, 2.0), (0, 0, 28), BLUE),
        Part(f"{name}_horn_screw", Cylinder(3.0, 2.0), (0, 0, 30), STEEL),
        *bolts,
        Part(f"{name}_idler", Cylinder(5.0, 4.75), (0, 0, -22.625), STEEL),
        Part(f"{name}_idler_cap", Cylinder(12.6, 2.0), (0, 0, -28), BLUE),
        Part(f"{name}_idler_nut", Cylinder(4.0, 3.0), (0, 0, -30.5), STEEL),
    ]


def base() -> list[Part]:
    """Return the pedestal: plate, feet, round housing, base servo and the servos' driver board."""
    feet = [
        Part(f"foot_{i}", Cylinder(9.0, 6.0), (58 * x, 58 * y, TABLE + 3.0), RUBBER)
        for i, (x, y) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1)))
    ]
    plugs = [
        Part(f"plug_{i}", Box((8.0, 8.0, 8.0)), (-60, 6 + 10 * i, -92.2), RUBBER)
        for i in range(-2, 3)
    ]
    return [
        *feet,
        Part("base_plate", Cylinder(76.0, 4.0), (0, 0, TABLE + 8.0), ALUMINIUM),
        Part("housing_foot", Cylinder(46.0, 4.0), (0, 0, -98.0), DARK),
        # hollow: 3 mm walls and a lid
        Part("housing", Cylinder(42.0, 40.0), (0, 0, -76.0), DARK, mass=0.055),
        Part("housing_band", Cylinder(42.6, 6.0), (0, 0, -86.0), BLUE, mass=0.004),
        Part("bearing_ring", Cylinder(35.5, 3.0), (0, 0, -54.5), STEEL, mass=0.030),
        Part("base_servo", Box((40.0, 20.0, 40.5)), (-10, 0, -77.0), CASE,
             mass=SERVO_MASS, drawn=False),
        Part("driver_board", Box((20.0, 60.0, 2.0)), (-58, 4, -97.2), BOARD),
        *plugs,
    ]  # fmt: skip


def turret() -> list[Part]:
    """Return link 1: turntable and the cradle that holds the shoulder servo upright."""
    return [
        Part("turntable", Cylinder(34.0, 5.0), (0, 0, -50.5), BLUE),
        Part("turntable_top", Cylinder(30.0, 4.0), (0, 0, -46.0), DARK),
        Part("cradle_floor", Box((40.0, 46.0, 2.0)), (0, 0, -43.0), ALUMINIUM),
        Part("cradle_front", Box((2.0, 34.0, 24.0)), (11.4, 2, -30.0), ALUMINIUM),
        Part("cradle_back", Box((2.0, 34.0, 38.0)), (-11.4, 2, -23.0), ALUMINIUM),
        Part("cable_clip", Box((7.0, 12.0, 8.0)), (-16, 12, -38.0), BLUE),
        *servo("shoulder_servo", (0, 0, 0), output=(0, -1, 0), tail=(0, 0, -1)),
    ]


def upper_arm() -> list[Part]:
    """Return link 2: fork, beam and the cradle that holds the elbow servo at its end."""
    rear = A2 - 30.0  # rear face of the elbow servo
    start, end = 37.0, rear - 11.0
    return [
        *fork("shoulder_fork"),
        Part("beam", Box((end - start, 17.0, 34.0)), ((start + end) / 2, 0, 0), BLUE),
        Part("elbow_cradle_back", Box((2.0, 24.0, 42.0)), (end + 1.0, 0, 0), ALUMINIUM),
        Part("elbow_cradle_top", Box((38.0, 2.0, 34.0)), (rear + 10.0, 11.4, -3), ALUMINIUM),
        Part("elbow_cradle_bottom", Box((22.0, 2.0, 34.0)), (rear + 2.0, -11.4, -3), ALUMINIUM),
        *cable("elbow_cable", 2.0, (43.0, 84.0), 14.4, -10.0, 8.5),
        Part("cable_tie_1", Box((5.0, 8.5, 8.0)), (50, 12.75, -10), DARK),
        Part("cable_tie_2", Box((5.0, 4.4, 8.0)), (70, 14.6, -10), DARK),
        *servo("elbow_servo", (A2, 0, 0), output=(0, 0, 1), tail=(-1, 0, 0)),
    ]


def forearm() -> list[Part]:
    """Return link 3, which carries the fingers: fork, gripper servo, palm, pinion and rods."""
    return [
        *fork("elbow_fork"),
        Part("tray_flange", Box((2.0, 26.0, 44.0)), (38, 0, -4), ALUMINIUM),
        Part("servo_tray", Box((43.0, 2.0, 52.0)), (60.5, -11.4, -4), ALUMINIUM),
        *servo("gripper_servo", (60.25, 0, 0), output=(1, 0, 0), tail=(0, 0, -1)),
        Part("palm", Box((3.0, 38.0, 104.0)), (83.5, 0, 0), ALUMINIUM),
        Part("pinion", Cylinder(PINION_RADIUS, 6.0, "x"), (88.0, 0, 0), STEEL, mass=0.004),
        Part("guide_rod_top", Cylinder(2.0, 96.0), (96.0, 14, 0), STEEL),
        Part("guide_rod_bottom", Cylinder(2.0, 96.0), (96.0, -14, 0), STEEL),
        Part("rail_end_right", Box((18.0, 38.0, 4.0)), (94.0, 0, 50), DARK),
        Part("rail_end_left", Box((18.0, 38.0, 4.0)), (94.0, 0, -50), DARK),
        *cable("gripper_cable", 2.2, (39.0, 56.0), 14.0, -18.0, 10.0),
    ]


def finger(name: str, side: float) -> list[Part]:
    """Return one finger with its rack; ``side`` is 1 for the right one (z > 0), -1 for the left.

    Its frame lies in the middle of the pad's face, along link 3's axes.
    """
    return [
        Part(f"{name}_rack", Box((6.0, 4.0, 54.0)), (88.0 - A3, side * 10.0, -side * 13.0), DARK),
        Part(f"{name}_carriage", Box((12.0, 36.0, 14.0)), (97.0 - A3, 0, side * 7.0), BLUE),
        Part(f"{name}_root", Box((26.0, 24.0, 5.0)), (116.0 - A3, 0, side * 5.5), BLUE),
        Part(f"{name}_plate", Box((38.0, 15.0, 4.0)), (148.0 - A3, 0, side * 5.0), ALUMINIUM),
        Part(f"{name}_pad", Box((32.0, 17.0, 3.0)), (0, 0, side * 1.5), RUBBER),
    ]


def finger_solids(side: float) -> list[tuple[Box | Cylinder, Vec]]:
    """Return what of a finger collides: pad, plate with root, and carriage."""
    return [
        (Box((32.0, 17.0, 3.0)), (0, 0, side * 1.5)),
        (Box((66.0, 24.0, 6.0)), (134.0 - A3, 0, side * 5.0)),
        (Box((18.0, 36.0, 14.0)), (94.0 - A3, 0, side * 7.0)),
    ]


LINKS: dict[str, list[Part]] = {
    "base_link": base(),
    "link1": turret(),
    "link2": upper_arm(),
    "link3": forearm(),
    "right_finger": finger("right_finger", 1.0),
    "left_finger": finger("left_finger", -1.0),
}

COLLISIONS: dict[str, list[tuple[Box | Cylinder, Vec]]] = {
    "base_link": [
        (Cylinder(76.0, 10.0), (0, 0, TABLE + 5.0)),
        (Cylinder(46.0, 47.0), (0, 0, -76.5)),
        (Box((22.0, 60.0, 13.0)), (-58, 4, -94.0)),
    ],
    "link1": [
        (Cylinder(36.0, 11.0), (0, 0, -47.5)),
        (Box((46.0, 46.0, 12.0)), (0, 0, -38.0)),
        (Box((26.0, 44.0, 59.0)), (0, 0, -12.5)),
    ],
    "link2": [(Box((77.0, 33.0, 64.0)), (25.5, 3, 0)), (Box((60.0, 34.0, 46.0)), (94.0, 2, 0))],
    "link3": [
        (Box((50.0, 26.0, 64.0)), (12.0, 0, 0)),
        (Box((66.0, 38.0, 104.0)), (70.0, 0, 0)),
    ],
    "right_finger": finger_solids(1.0),
    "left_finger": finger_solids(-1.0),
}

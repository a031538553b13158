"""Named servos from their makers' data sheets, and robots that are limited by them.

A URDF's effort and velocity are what its author typed; a servo's are what its motor gives. Data
sheets speak of kgf cm, of oz in and of seconds for 60 degrees: they are converted here, once.

Torque and speed scale with the supply voltage, as those of a DC motor do.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from arm3dof.errors import FrameNotFound, InputError, Problem
from arm3dof.model.urdf import Joint, Urdf

if TYPE_CHECKING:
    from arm3dof.model.robot import Robot

KGF_CM = 0.0980665
"""One kilogram-force centimetre [N m]."""
OZF_IN = 0.00706155181
"""One ounce-force inch [N m]."""
TOLERATED = 1.2
"""How many times its servo's torque a joint's effort may be before it is worth a warning."""

_TURN = 2 * math.pi
_SAME_TRAVEL = 1e-6  # [rad]


@dataclass(frozen=True)
class ServoData:
    """What a data sheet says about a servo at one supply voltage.

    Attributes:
        name: its name in the catalogue.
        maker: who makes it.
        voltage: the supply voltage that torque and speed are stated for [V].
        stall_torque: torque at standstill [N m].
        no_load_speed: speed without load [rad/s].
        mass: [kg].
        resolution: smallest step of position that it tells apart [rad]; for a servo that is
            commanded by pulses, its dead band.
        travel: range of position [rad].
        source: the data sheet.
    """

    name: str
    maker: str
    voltage: float
    stall_torque: float
    no_load_speed: float
    mass: float
    resolution: float
    travel: float
    source: str

    def at_voltage(self, voltage: float) -> ServoData:
        """Return the servo on another supply; torque and speed are proportional to it.

        Raises:
            InputError: the voltage is not positive and finite.
        """
        if not (math.isfinite(voltage) and voltage > 0):
            raise InputError(f"the supply of {self.name} is {voltage!r}; give volts above 0")
        share = voltage / self.voltage
        return replace(
            self,
            voltage=float(voltage),
            stall_torque=share * self.stall_torque,
            no_load_speed=share * self.no_load_speed,
        )


def _seconds_for_60_deg(seconds: float) -> float:
    return _TURN / 6 / seconds


def _rpm(turns: float) -> float:
    return turns * _TURN / 60


def _pulse_width(dead_band_us: float, travel: float, span_us: float = 2000.0) -> float:
    """Return the angle that a dead band of some microseconds of the pulse leaves open [rad]."""
    return dead_band_us / span_us * travel


_SHEETS = (
    ServoData(
        "DS3218",
        "DSServo",
        6.8,
        20.0 * KGF_CM,
        _seconds_for_60_deg(0.14),
        0.060,
        _pulse_width(3.0, math.radians(270)),
        math.radians(270),
        "DSServo DS3218, 270 degree version (6.8 V): nominal, from sellers' listings; some say "
        "21.5 kgf cm, the lower figure is kept",
    ),
    ServoData(
        "MG996R",
        "Tower Pro",
        6.0,
        11.0 * KGF_CM,
        _seconds_for_60_deg(0.14),
        0.055,
        _pulse_width(5.0, math.radians(120), 1000.0),
        math.radians(120),
        "Tower Pro, MG996R high torque metal gear dual ball bearing servo, data sheet (6 V) as "
        "quoted by resellers; it turns farther with pulses outside 1 to 2 ms",
    ),
    ServoData(
        "STS3215-7.4V",
        "Feetech",
        7.4,
        19.5 * KGF_CM,
        _seconds_for_60_deg(0.222),
        0.055,
        _TURN / 4096,
        _TURN,
        "Feetech, STS3215-C001 serial bus servo, product specification (7.4 V, gears 1:345)",
    ),
    ServoData(
        "STS3215-12V",
        "Feetech",
        12.0,
        30.0 * KGF_CM,
        _seconds_for_60_deg(0.222),
        0.055,
        _TURN / 4096,
        _TURN,
        "Feetech, STS3215-C018 serial bus servo, product specification (12 V, gears 1:345)",
    ),
    ServoData(
        "XL330",
        "ROBOTIS",
        5.0,
        0.52,
        _rpm(103),
        0.018,
        _TURN / 4096,
        _TURN,
        "ROBOTIS e-Manual, DYNAMIXEL XL330-M288-T, specifications (5 V)",
    ),
    ServoData(
        "XL430",
        "ROBOTIS",
        12.0,
        1.5,
        _rpm(61),
        0.0572,
        _TURN / 4096,
        _TURN,
        "ROBOTIS e-Manual, DYNAMIXEL XL430-W250-T, specifications (12 V); TurtleBot3 manual",
    ),
    ServoData(
        "LX-16A",
        "Hiwonder",
        7.4,
        17.0 * KGF_CM,
        _seconds_for_60_deg(0.16),
        0.052,
        math.radians(0.24),
        math.radians(240),
        "Hiwonder (LewanSoul) LX-16A (7.4 V): nominal, from sellers' listings",
    ),
)

SERVOS: Mapping[str, ServoData] = MappingProxyType({servo.name: servo for servo in _SHEETS})
"""The catalogue, by name."""

ALIASES: Mapping[str, str] = MappingProxyType({"STS3215": "STS3215-7.4V"})
"""Other names: where a name leaves the version open it means the weaker one."""

Servos = str | Mapping[str, str]
"""The servo of every joint that turns, or of some joints by the joint's name."""


def servo_data(name: str) -> ServoData:
    """Return a servo of the catalogue; upper and lower case are the same.

    Raises:
        InputError: the catalogue has no such servo.
    """
    names = {known.casefold(): known for known in (*SERVOS, *ALIASES)}
    known = names.get(str(name).casefold())
    if known is None:
        close = difflib.get_close_matches(str(name).casefold(), names, n=1)
        guess = f"; did you mean '{names[close[0]]}'?" if close else ";"
        raise InputError(f"no servo '{name}'{guess} there are: {', '.join(SERVOS)}")
    return SERVOS[ALIASES.get(known, known)]


def fit_servos(urdf: Urdf, servos: Servos, locked: Collection[str] = ()) -> str:
    """Return a URDF's text with the limits that its servos have.

    Effort and velocity become the servo's. A range wider than the servo's travel is narrowed to it
    around its middle; a joint that turns freely gets the travel around zero.

    Args:
        urdf: a robot whose links form a tree.
        servos: one servo for every joint that turns and is not locked, or servos by joint.
        locked: joints that are held fixed.

    Raises:
        InputError: a servo is unknown, or a joint does not turn.
        FrameNotFound: the robot has no such joint.
    """
    chosen = _by_joint(urdf, servos, locked)
    root = ElementTree.fromstring(urdf.text)
    for element in root.iterfind("joint"):
        if element.get("name") in chosen:
            joint, servo = chosen[str(element.get("name"))]
            _limit(element, joint, servo)
    return ElementTree.tostring(root, encoding="unicode")


def effort_warnings(robot: Robot, servos: Servos) -> tuple[Problem, ...]:
    """Return a warning for each joint whose effort exceeds its servo's torque by over 20 %.

    Args:
        robot: a robot with the efforts of its file.
        servos: what drives it; joints that the robot does not have are left out.

    Raises:
        InputError: a servo is unknown.
    """
    warnings = []
    for index, name in enumerate(robot.joint_names):
        choice = servos if isinstance(servos, str) else servos.get(name)
        if choice is None:
            continue
        servo, effort = servo_data(choice), float(robot.limits.tau_max[index])
        if effort > TOLERATED * servo.stall_torque:
            warnings.append(
                Problem(
                    f"joint '{name}'",
                    f"its effort is {effort:g} N m, but servo {servo.name} stalls at "
                    f"{servo.stall_torque:.2f} N m ({servo.voltage:g} V)",
                    f"load it with servos={servo.name!r} (--servos {servo.name})",
                )
            )
    return tuple(warnings)


def _by_joint(
    urdf: Urdf, servos: Servos, locked: Collection[str]
) -> dict[str, tuple[Joint, ServoData]]:
    moving = {joint.name: joint for joint in urdf.moving_joints}
    if isinstance(servos, str):
        servo = servo_data(servos)
        return {
            name: (joint, servo)
            for name, joint in moving.items()
            if _turns(joint) and name not in locked
        }
    for name in servos:
        if name not in moving:
            raise FrameNotFound(name, moving, "joint")
        if not _turns(moving[name]):
            raise InputError(f"joint '{name}' slides; give servos to joints that turn")
    return {name: (moving[name], servo_data(servo)) for name, servo in servos.items()}


def _turns(joint: Joint) -> bool:
    return joint.kind in ("revolute", "continuous")


def _limit(element: ElementTree.Element, joint: Joint, servo: ServoData) -> None:
    limit = element.find("limit")
    if limit is None:
        limit = ElementTree.SubElement(element, "limit")
    limit.set("effort", repr(servo.stall_torque))
    limit.set("velocity", repr(servo.no_load_speed))
    if not joint.upper - joint.lower > servo.travel + _SAME_TRAVEL:
        return
    middle = (joint.lower + joint.upper) / 2 if math.isfinite(joint.upper - joint.lower) else 0.0
    element.set("type", "revolute")
    limit.set("lower", repr(middle - servo.travel / 2))
    limit.set("upper", repr(middle + servo.travel / 2))

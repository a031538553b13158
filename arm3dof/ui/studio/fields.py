"""The numbers that can be tuned: their ranges, their units, what they do, and where they live."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from arm3dof.control.settings import MpcSettings
from arm3dof.errors import RobotError
from arm3dof.model.overrides import override_values
from arm3dof.model.robot import Robot
from arm3dof.model.tree import link_of_frame
from arm3dof.model.urdf import Urdf, read_urdf
from arm3dof.runtime.live import commands as cmd


@dataclass(frozen=True)
class Field:
    """A number that a person may choose.

    Attributes:
        key: its name in the code.
        label: its name on the page.
        unit: its unit; empty for a pure number.
        low: least value.
        high: greatest value.
        step: distance of neighbouring values.
        tip: what it does.
    """

    key: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    tip: str

    @property
    def tooltip(self) -> str:
        """Return what the pointer shows: the effect, then the unit."""
        return f"{self.tip} [{self.unit}]" if self.unit else self.tip


CONTROLLER_NAMES = {
    "mpc": "MPC",
    "computed-torque": "Computed torque",
    "pd-gravity": "PD + gravity",
    "pid": "PID",
    "pd": "PD",
}
FORMULATIONS = {"tracking": "Tracking", "torque": "Torque", "paper": "As in the paper"}

CONTROL_FIELDS = (
    Field("horizon", "Horizon N", "", 2, 60, 1, "Stages that the controller looks ahead"),
    Field("dt", "Sampling T", "ms", 5, 100, 5, "Time between two control steps"),
    Field("position", "Position Q", "", -2, 2, 0.1, "Weight of the error, a power of ten [1/rad²]"),
    Field(
        "velocity", "Velocity Q", "", -4, 1, 0.1, "Weight of the speed, a power of ten [s²/rad²]"
    ),
    Field("input", "Input R", "", -6, 0, 0.1, "Weight of the input, a power of ten [s⁴/rad²]"),
    Field(
        "observer_gain",
        "Observer",
        "",
        0,
        1,
        0.05,
        "Share of an unexplained torque that is learned in a step; 0 switches the observer off",
    ),
    Field("delay", "Motor delay", "ms", 0, 200, 5, "Time from a command to its torque"),
)

_LINK_TIPS = {
    "mass": ("Mass", "kg", "Mass of the link"),
    "com.x": ("Centroid x", "m", "Centre of mass in the link's frame"),
    "com.y": ("Centroid y", "m", "Centre of mass in the link's frame"),
    "com.z": ("Centroid z", "m", "Centre of mass in the link's frame"),
    "length": ("Length", "m", "Distance to the next joint, or to the tool"),
}
_JOINT_TIPS = {
    "effort": ("Torque limit", "N m", "Highest torque of the joint's servo"),
    "velocity": ("Speed limit", "rad/s", "Highest speed of the joint"),
    "damping": ("Damping", "N m s", "Viscous friction"),
    "friction": ("Friction", "N m", "Coulomb friction"),
}
_SMALLEST = {"mass": 0.005, "length": 0.02, "effort": 0.1, "velocity": 0.5}


def control_values(control: cmd.Control) -> dict[str, float]:
    """Return what the sliders of ``CONTROL_FIELDS`` show for a controller."""
    settings = control.settings()
    position, velocity = np.broadcast_to(np.ravel(settings.state_weight)[:2], 2).tolist()
    return {
        "horizon": settings.horizon,
        "dt": round(1e3 * settings.dt, 3),
        "position": _power(position),
        "velocity": _power(velocity),
        "input": _power(float(np.ravel(settings.input_weight)[0])),
        "observer_gain": settings.gain,
        "delay": round(1e3 * control.delay, 3),
    }


def with_value(control: cmd.Control, key: str, value: float) -> cmd.Control:
    """Return a controller with one number of ``CONTROL_FIELDS`` changed.

    Raises:
        InputError: the number is outside its domain.
    """
    mpc: dict[str, Any] = dict(control.mpc)
    delay = control.delay
    weights = [float(w) for w in np.ravel(control.settings().state_weight)[:2]]
    match key:
        case "horizon":
            mpc["horizon"] = round(value)
        case "dt":
            mpc["dt"] = round(value) / 1000
        case "position":
            mpc["state_weight"] = (10.0**value, weights[1])
        case "velocity":
            lowest = next(field.low for field in CONTROL_FIELDS if field.key == "velocity")
            mpc["state_weight"] = (weights[0], 10.0**value if value > lowest else 0.0)
        case "input":
            mpc["input_weight"] = 10.0**value
        case "delay":
            delay = round(value) / 1000
            if mpc.get("delay"):
                mpc["delay"] = delay
        case _:
            mpc[key] = value
    return cmd.Control(control.controller, mpc, delay, control.gains)


def control_changes(control: cmd.Control) -> list[str]:
    """Return what differs from the default controller, one line each."""
    lines = []
    if control.controller != "mpc":
        lines.append(f"controller = {CONTROLLER_NAMES[control.controller]}")
    plain = MpcSettings()
    for key, value in control.mpc.items():
        default = getattr(plain, key)
        if not np.array_equal(np.asarray(value), np.asarray(default)):
            lines.append(f"{key} = {_plain(value)} (default {_plain(default)})")
    if control.delay:
        lines.append(f"motor delay = {1e3 * control.delay:.0f} ms (default 0)")
    return lines


def parts_of(robot: Robot) -> dict[str, str]:
    """Return the links that move and the joints, by what ``part_fields`` takes."""
    urdf = _urdf(robot)
    moved = [joint.child for joint in urdf.moving_joints if joint.name in robot.joint_names]
    links = {f"link {name}": f"{name} (link)" for name in moved}
    return links | {f"joint {name}": f"{name} (joint)" for name in robot.joint_names}


def part_fields(robot: Robot, part: str) -> list[tuple[Field, float]]:
    """Return the numbers of a link or joint that can be changed, with their values.

    Args:
        robot: the arm.
        part: one of ``parts_of``.
    """
    kind, _, name = part.partition(" ")
    tips = _LINK_TIPS if kind == "link" else _JOINT_TIPS
    values = arm_values(robot)
    keys = {f"{name}.{field}": tip for field, tip in tips.items() if f"{name}.{field}" in values}
    return [(_field(key, *tip, values[key]), values[key]) for key, tip in keys.items()]


def arm_values(robot: Robot) -> dict[str, float]:
    """Return every number of an arm that can be changed, by its key."""
    urdf = _urdf(robot)
    return override_values(urdf, link_of_frame(urdf, robot.tool_frame))


def _field(key: str, label: str, unit: str, tip: str, value: float) -> Field:
    field = key.split(".", 1)[1]
    if field.startswith("com"):
        return Field(key, label, unit, -0.15, 0.15, 0.001, tip)
    top = 4 * value if value > 0 else {"damping": 0.2, "friction": 0.3}.get(field, 1.0)
    digits = math.floor(math.log10(top)) - 2
    step = 10.0**digits
    return Field(
        key, label, unit, _SMALLEST.get(field, 0.0), math.ceil(top / step) * step, step, tip
    )


def _urdf(robot: Robot) -> Urdf:
    urdf, _ = read_urdf(robot.description.urdf)
    if urdf is None:
        raise RobotError(robot.name, ())  # a robot has been built from it
    return urdf


def _power(value: float) -> float:
    """Return the power of ten of a weight; the lowest of all for 0."""
    return round(math.log10(value), 3) if value > 0 else -4.0


def _plain(value: object) -> str:
    return ", ".join(f"{x:g}" if isinstance(x, float | int) else str(x) for x in _each(value))


def _each(value: object) -> list[object]:
    return list(value) if isinstance(value, tuple | list) else [value]

"""Robots that can be loaded by name, and where their files lie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from arm3dof.errors import InputError, MissingExtra

_EXTRA = "example-robot-data"
_PACKAGE = Path(__file__).parents[1]
_BUNDLED_FOLDERS = (_PACKAGE / "urdf", _PACKAGE.parent / "urdf")  # in a wheel; in a checkout


@dataclass(frozen=True)
class AddedTool:
    """A tool frame for a robot whose file has none at its fingertips.

    Attributes:
        parent: the link that it is fixed to.
        xyz: its place in that link's frame [m].
    """

    parent: str
    xyz: tuple[float, float, float]


@dataclass(frozen=True)
class LibraryRobot:
    """A robot of example-robot-data.

    Attributes:
        path: the URDF, from the folder ``robots`` on.
        joints: number of joints that move with the default locks.
        tool_frame: its tool.
        locked_joints: joints that are no part of the arm, and where they are held [rad or m].
        added_tool: where the tool frame is, if the file has none.
        note: what one should know before trusting the file.
        servo: what drives its joints, by name in ``arm3dof.model.servos``; ``None`` if unknown.
    """

    path: str
    joints: int
    tool_frame: str
    locked_joints: Mapping[str, float] = field(default_factory=dict)
    added_tool: AddedTool | None = None
    note: str = ""
    servo: str | None = None


_STS3215 = "its STS3215 servos stall at 2.94 N m (12 V): load it with servos='STS3215-12V'"

LIBRARY: Mapping[str, LibraryRobot] = {
    "ur5": LibraryRobot("ur_description/urdf/ur5_robot.urdf", 6, "tool0"),
    "panda": LibraryRobot(
        "panda_description/urdf/panda.urdf",
        7,
        "panda_hand_tcp",
        {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0},
        note="fingers locked, closed",
    ),
    "z1": LibraryRobot(
        "z1_description/urdf/z1.urdf",
        6,
        "tool",
        {"jointGripper": 0.0},
        AddedTool("gripperStator", (0.14, 0.0, -0.009)),
        "gripper locked, closed; the tool frame between its fingertips is ours",
    ),
    "so100": LibraryRobot(
        "so_arm_description/urdf/so100.urdf",
        5,
        "tool",
        {"gripper": 0.0},
        AddedTool("gripper", (0.0, -0.098, 0.0)),
        "jaw locked; the tool frame between its fingertips is ours; the file says 35 N m, but "
        + _STS3215,
        "STS3215-12V",
    ),
    "so101": LibraryRobot(
        "so_arm_description/urdf/so101.urdf",
        5,
        "gripper_frame_link",
        {"gripper": 0.0},
        note="jaw locked; the file says 10 N m, but " + _STS3215,
        servo="STS3215-12V",
    ),
    "xarm7": LibraryRobot("xarm_description/urdf/xarm7.urdf", 7, "link_eef"),
}
"""The robots of example-robot-data that are known by a short name."""


def bundled_names() -> tuple[str, ...]:
    """Return the names of the robots that come with the package, sorted."""
    found = {path.stem for folder in _BUNDLED_FOLDERS for path in folder.glob("*.urdf")}
    return tuple(sorted(found))


def bundled_urdf(name: str) -> Path:
    """Return the path of a URDF that comes with the package.

    Args:
        name: a name of ``bundled_names``.

    Raises:
        InputError: there is no such robot.
    """
    for folder in _BUNDLED_FOLDERS:
        path = folder / f"{name}.urdf"
        if name in bundled_names() and path.is_file():
            return path
    names = ", ".join(bundled_names())
    raise InputError(f"no bundled robot '{name}'; there are: {names}")


def library_share() -> Path | None:
    """Return the folder that example-robot-data's ``package://`` names start from, if installed."""
    from importlib import metadata  # slow to import, and the bundled robots need none of it

    try:
        installed = metadata.distribution(_EXTRA)
    except metadata.PackageNotFoundError:
        return None
    return Path(str(installed.locate_file("cmeel.prefix/share"))).resolve()


def library_urdf(name: str) -> tuple[Path, Path]:
    """Return the path of a library robot's URDF, and the folder that its meshes are found from.

    Args:
        name: a name of ``LIBRARY``.

    Raises:
        MissingExtra: example-robot-data is not installed.
    """
    share = library_share()
    if share is None:
        raise MissingExtra(f"robot '{name}'", "robots")
    return share / _EXTRA / "robots" / LIBRARY[name].path, share

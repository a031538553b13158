"""Loading robots by name or by path, and listing what can be loaded."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

from arm3dof.errors import InputError, MissingFile, Problem, RobotError
from arm3dof.model.build import build_robot, default_tool, robot_from_description
from arm3dof.model.catalogue import (
    LIBRARY,
    AddedTool,
    bundled_names,
    bundled_urdf,
    library_share,
    library_urdf,
)
from arm3dof.model.overrides import apply_overrides
from arm3dof.model.robot import STANDARD_GRAVITY, Description, Robot
from arm3dof.model.servos import Servos, fit_servos
from arm3dof.model.tree import link_of_frame
from arm3dof.model.urdf import Urdf, read_urdf
from arm3dof.model.validate import coupled_joints, judge, lock_positions, structure_problems

__all__ = [
    "RobotEntry",
    "bundled_urdf",
    "known_servo",
    "list_robots",
    "load_robot",
    "problems_of",
    "robot_from_description",
]

_LIBRARY_SOURCE = "example-robot-data"
_BUNDLED_NOTES = {"arm3dof": "the reference arm: three DS3218 servos; gripper held open"}
_BUNDLED_SERVOS = {"arm3dof": "DS3218"}


@dataclass(frozen=True)
class RobotEntry:
    """One line of the list of robots.

    Attributes:
        name: what to give to ``load_robot``.
        source: ``bundled`` or ``example-robot-data``.
        installed: whether it can be loaded now.
        joints: number of joints that move.
        tool_frame: the frame that is brought to targets.
        note: what one should know before using it; may be empty.
    """

    name: str
    source: str
    installed: bool
    joints: int
    tool_frame: str
    note: str


@dataclass(frozen=True)
class _Found:
    """A robot's file and what is known about it before it is read."""

    name: str
    data: str | bytes
    folder: Path
    share: Path | None = None
    locked_joints: Mapping[str, float] | None = None
    tool_frame: str | None = None

    def locks(
        self, asked: Mapping[str, float] | Collection[str] | None, urdf: Urdf
    ) -> dict[str, float]:
        """Return where joints are held: as asked, else as known, and fingers that are coupled."""
        if asked is None:
            asked = coupled_joints(urdf) if self.locked_joints is None else self.locked_joints
        locked = lock_positions(urdf, asked)
        if locked and self.locked_joints is None:
            locked |= lock_positions(urdf, coupled_joints(urdf, named=locked))
        return locked


def load_robot(
    source: str | Path = "arm3dof",
    *,
    overrides: Mapping[str, float] | None = None,
    locked_joints: Mapping[str, float] | Collection[str] | None = None,
    tool_frame: str | None = None,
    servos: Servos | None = None,
) -> Robot:
    """Load a robot and validate it.

    Args:
        source: a bundled name, ``ur5``, ``panda``, ``z1``, ``so100``, ``so101`` or ``xarm7``
            (extra ``robots``), or the path of a URDF file.
        overrides: URDF parameters to change, such as ``{"link2.mass": 0.2}``; see
            ``arm3dof.model.overrides``.
        locked_joints: joints to hold fixed: names (held at 0, or at the limit nearest to it) or
            names with positions [rad or m]; what mimics a locked joint follows it. It replaces
            the default of a library robot, its fingers. In others (the bundled arm too) joints
            that another one mimics, as the fingers of a gripper do, are held at 0 besides,
            unless one of them is named, or ``()`` asks for no lock at all.
        tool_frame: the frame to bring to targets. Without it: a library robot's own; for another
            robot the first link that moves and is called tool, tool0, tcp, ee_link or the like
            (``build.TOOL_NAMES``), else the last link of its longest chain.
        servos: a servo of ``arm3dof.model.servos.SERVOS`` that drives every joint, or servos by
            joint: their torque and speed become the joints' limits, and their travel where it is
            narrower. An override of the same limit goes before.

    Raises:
        InputError: the name, an override, a servo or a locked position is not valid.
        MissingFile: there is no such file, or it cannot be read.
        MissingExtra: the robot is in an extra that is not installed.
        RobotError: the URDF is broken or unsupported; ``.problems`` has every reason.
        FrameNotFound: the robot has no such joint to lock, or no such tool frame.
    """
    found = _find(source)
    gravity = STANDARD_GRAVITY
    urdf, problems = _read(found)
    locked = found.locks(locked_joints, urdf)
    tool = tool_frame or found.tool_frame
    if servos and not (problems or structure_problems(urdf, locked)):
        urdf, problems = _read(replace(found, data=fit_servos(urdf, servos, locked)))
    if overrides and not (problems or structure_problems(urdf, locked)):
        tool_link = link_of_frame(urdf, tool or default_tool(urdf, locked))
        text, gravity = apply_overrides(urdf, overrides, tool_link)
        urdf, problems = _read(replace(found, data=text))
        locked = found.locks(locked_joints, urdf)
    problems += judge(urdf, locked)
    if problems:
        raise RobotError(found.name, problems)
    package_dirs = _package_dirs(found, urdf)
    description = Description(found.name, urdf.text, package_dirs, locked, gravity)
    return build_robot(urdf, description, tool)


def problems_of(
    source: str | Path, *, locked_joints: Mapping[str, float] | Collection[str] | None = None
) -> tuple[Problem, ...]:
    """Return everything that keeps a robot from being loaded; nothing when it can be.

    Args:
        source: as for ``load_robot``.
        locked_joints: as for ``load_robot``.

    Raises:
        InputError: the name or a locked position is not valid.
        MissingFile: there is no such file, or it cannot be read.
        MissingExtra: the robot is in an extra that is not installed.
        FrameNotFound: the robot has no such joint to lock.
    """
    found = _find(source)
    urdf, problems = read_urdf(found.data)
    if urdf is None:
        return problems
    return (*problems, *judge(urdf, found.locks(locked_joints, urdf)))


def known_servo(source: str | Path) -> str | None:
    """Return the servo that a robot is known to be built with; ``None`` for nothing known.

    Args:
        source: as for ``load_robot``.
    """
    name = str(source)
    return LIBRARY[name].servo if name in LIBRARY else _BUNDLED_SERVOS.get(name)


def list_robots() -> tuple[RobotEntry, ...]:
    """Return the robots that can be loaded by name, the bundled ones first; no model is built."""
    installed = library_share() is not None
    library = (
        RobotEntry(
            name, "example-robot-data", installed, robot.joints, robot.tool_frame, robot.note
        )
        for name, robot in LIBRARY.items()
    )
    return (*(_bundled_entry(name) for name in bundled_names()), *library)


def _bundled_entry(name: str) -> RobotEntry:
    urdf, _ = _read(_find(name))
    locked = lock_positions(urdf, coupled_joints(urdf))
    joints = len(urdf.moving_joints) - len(locked)
    note = _BUNDLED_NOTES.get(name, "")
    return RobotEntry(name, "bundled", True, joints, default_tool(urdf, locked), note)


# ---- finding a file ----------------------------------------------------------------------------


def _find(source: str | Path) -> _Found:
    name = str(source)
    if name in LIBRARY:
        return _find_library(name)
    if name in bundled_names():
        path = bundled_urdf(name)
        return _Found(name, _read_file(path), path.parent)
    path = Path(source).expanduser()
    if not path.is_file() and path.parent == Path() and not path.suffix and name != ".":
        raise _unknown_name(name)
    return _Found(name, _read_file(path), path.resolve().parent)


def _find_library(name: str) -> _Found:
    robot = LIBRARY[name]
    path, share = library_urdf(name)
    data = _read_file(path)
    if robot.added_tool is not None:
        data = _with_tool(data, robot.tool_frame, robot.added_tool)
    return _Found(name, data, path.parent, share, robot.locked_joints, robot.tool_frame)


def _with_tool(data: bytes, name: str, tool: AddedTool) -> bytes:
    root = ElementTree.fromstring(data)
    ElementTree.SubElement(root, "link", name=name)
    joint = ElementTree.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=tool.parent)
    ElementTree.SubElement(joint, "child", link=name)
    ElementTree.SubElement(joint, "origin", xyz=" ".join(str(x) for x in tool.xyz))
    return ElementTree.tostring(root)


def _read_file(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise MissingFile(f"robot file {path}: {reason}; give the path of a URDF") from None
    except ValueError as error:
        raise InputError(f"robot file {str(path)!r}: {error}; give the path of a URDF") from None


def _unknown_name(name: str) -> InputError:
    names = (*bundled_names(), *LIBRARY)
    close = difflib.get_close_matches(name, names, n=1)
    guess = f"; did you mean '{close[0]}'?" if close else ";"
    return InputError(
        f"no robot '{name}'{guess} there are: {', '.join(names)}; or give the path of a URDF file"
    )


def _read(found: _Found) -> tuple[Urdf, tuple[Problem, ...]]:
    urdf, problems = read_urdf(found.data)
    if urdf is None:
        raise RobotError(found.name, problems)
    return urdf, problems


def _package_dirs(found: _Found, urdf: Urdf) -> tuple[Path, ...]:
    """Return where the robot's meshes are looked for.

    A library robot's are found from one known folder. For another file it is the file's own
    folder, for names relative to it, and every folder above that holds a package that it names.
    """
    if found.share is not None:
        return (found.share,)
    packages = set(re.findall(r'filename="package://([^/"]+)/', urdf.text))
    above = (
        folder
        for folder in found.folder.parents
        if any((folder / package).is_dir() for package in packages)
    )
    return (found.folder, *above)

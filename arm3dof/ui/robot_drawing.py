"""A robot as shapes that hang on its links, and where each link is: for a page, or without one.

Every link has a node ``/robot/LINK`` whose pose is the link's pose in the base frame, so that
poses can be read back from the page; its shapes are fixed below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from arm3dof.model.gripper import Gripper, find_gripper, with_free_gripper
from arm3dof.model.robot import Robot
from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.facets import Piece
from arm3dof.ui.meshcat_window import Command
from arm3dof.ui.visuals import Visual, read_visuals, stick_figure


class RobotDrawing:
    """A robot below one node of the scene.

    Args:
        robot: what to draw; its model is only read, so it may be used elsewhere meanwhile.
        path: the node, for example ``/robot``.
        color: one colour for the whole robot, in place of its own; see-through for a ghost.

    Attributes:
        link_names: the links, each drawn at ``PATH/LINK``.
        visuals: the shapes, each fixed to a link.
        stand_ins: links whose meshes are missing and that are drawn as a stick figure.
    """

    def __init__(
        self, robot: Robot, path: str = "/robot", color: Sequence[float] | None = None
    ) -> None:
        self._robot = robot
        self._model = robot.model
        self._data = self._model.createData()
        self._path = path
        self._color = color
        links = {
            frame.name: index
            for index, frame in enumerate(self._model.frames)
            if frame.type == pin.FrameType.BODY
        }
        self._frames = tuple(links.values())
        self.link_names: tuple[str, ...] = tuple(links)
        visuals, missing = read_visuals(robot.description)
        drawn = {visual.link for visual in visuals}
        self.stand_ins: tuple[str, ...] = tuple(name for name in missing if name not in drawn)
        if self.stand_ins or not visuals:
            visuals += stick_figure(self._model, robot.tool_frame, drawn)
        self.visuals: tuple[Visual, ...] = visuals

    @cached_property
    def _hand(self) -> _Hand | None:
        """The gripper's own model, which only a drawing whose fingers move needs."""
        return _Hand.of(self._robot, self.link_names)

    def node(self, link: str) -> str:
        """Return the path of a link's node."""
        return f"{self._path}/{link}"

    def moves(self, link: str) -> bool:
        """Return whether a link ever moves."""
        frame = self._frames[self.link_names.index(link)]
        return bool(self._model.frames[frame].parentJoint > 0)

    def objects(self) -> list[Command]:
        """Return the commands that draw every shape."""
        commands: list[Command] = []
        count: dict[str, int] = {}
        for visual in self.visuals:
            number = count[visual.link] = count.get(visual.link, -1) + 1
            path = f"{self.node(visual.link)}/{number}"
            look = shapes.material(self._color or visual.color, side=2 if visual.is_mesh else 0)
            commands.append(shapes.draw(path, visual.shape, look))
            commands.append(shapes.pose(path, visual.placement))
        return commands

    def placements(self, q: Array, opening: float | None = None) -> Array:
        """Return the pose of each link in the base frame, shape (links, 4, 4).

        Args:
            q: joint positions, shape (nv,) [rad].
            opening: of the gripper [m]; as the robot's model holds it when ``None``.
        """
        if opening is not None and self._hand is not None:
            return self._hand.placements(q, opening)
        pin.framesForwardKinematics(self._model, self._data, q)
        return np.array([self._data.oMf[index].homogeneous for index in self._frames])

    def poses(self, q: Array) -> list[Command]:
        """Return the commands that put every link where it is at ``q``."""
        return [
            shapes.pose(self.node(name), transform)
            for name, transform in zip(self.link_names, self.placements(q), strict=True)
        ]

    def outline(self, configurations: Array) -> Array:
        """Return points that bound all shapes at some configurations, shape (k, 3) [m].

        Args:
            configurations: joint positions, shape (n, nv) [rad].
        """
        boxes = self._outlines()
        points = [np.zeros((0, 3))]
        for q in configurations:
            for transform, box in zip(self.placements(q), boxes, strict=True):
                points.append(box @ transform[:3, :3].T + transform[:3, 3])
        return np.concatenate(points)

    def enclosing_ball(self, configurations: Array) -> tuple[Array, float]:
        """Return centre, shape (3,) [m], and radius [m] of a ball around all shapes.

        Args:
            configurations: joint positions, shape (n, nv) [rad].
        """
        points = self.outline(configurations)
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        return center, float(np.linalg.norm(points - center, axis=1).max())

    def pieces(self) -> list[Piece]:
        """Return every shape for drawing without a page; the owners are the links, in order."""
        numbers = {name: number for number, name in enumerate(self.link_names)}
        return [
            Piece(numbers[each.link], each.shape, each.placement, self._color or each.color)
            for each in self.visuals
        ]

    def floor(self) -> float:
        """Return the height of the lowest point that never moves [m]; 0 when there is none."""
        transforms = self.placements(pin.neutral(self._model))
        heights = [0.0]
        for link, transform, box in zip(self.link_names, transforms, self._outlines(), strict=True):
            if not self.moves(link) and len(box):
                heights.append(float((box @ transform[2, :3] + transform[2, 3]).min()))
        return min(heights)

    def _outlines(self) -> list[Array]:
        found: dict[str, list[Visual]] = {name: [] for name in self.link_names}
        for visual in self.visuals:
            found[visual.link].append(visual)
        return [
            np.concatenate([np.zeros((0, 3)), *(visual.outline for visual in visuals)])
            for visuals in found.values()
        ]


class _Hand:
    """A robot whose fingers move: where its links are at any opening of the gripper."""

    def __init__(self, robot: Robot, gripper: Gripper, links: tuple[str, ...]) -> None:
        self._free, self._gripper, self._links = with_free_gripper(robot, gripper), gripper, links
        names = self._free.joint_names
        self._arm = [names.index(name) for name in robot.joint_names]
        self._fingers = [names.index(name) for name in gripper.joints]
        self._q = np.zeros(self._free.nv)

    @staticmethod
    def of(robot: Robot, links: tuple[str, ...]) -> _Hand | None:
        """Return the hand of a robot; None for a robot without one."""
        gripper = find_gripper(robot)
        return None if gripper is None else _Hand(robot, gripper, links)

    def placements(self, q: Array, opening: float) -> Array:
        """Return the pose of each link in the base frame, shape (links, 4, 4)."""
        driven = self._gripper.position_of(opening)
        follower = self._gripper.follower.multiplier * driven + self._gripper.follower.offset
        self._q[self._arm], self._q[self._fingers] = q, (driven, follower)
        return np.array([it.homogeneous for it in self._free.placements(self._q, self._links)])

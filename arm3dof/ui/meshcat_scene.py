"""A robot, its target and its path on a page: what is drawn, and where each link is.

Every link has a node ``/robot/LINK`` whose pose is the link's pose in the base frame, so that
poses can be read back from the page; its shapes are fixed below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm3dof.model.gripper import Gripper, find_gripper, with_free_gripper
from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array, frozen_array
from arm3dof.ui import shapes
from arm3dof.ui.facets import Piece
from arm3dof.ui.meshcat_window import Command, MeshcatWindow
from arm3dof.ui.replay import caption_command, no_replay, replay_command, sample_rows
from arm3dof.ui.stage import stage_commands, view_command
from arm3dof.ui.things import draw_world
from arm3dof.ui.tube import tube
from arm3dof.ui.visuals import Visual, read_visuals, stick_figure

TARGET = (0.902, 0.376, 0.0)
PATH_START, PATH_END = (0.337, 0.706, 0.914), (0.0, 0.447, 0.698)
GHOST = (0.0, 0.447, 0.698, 0.22)


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
        for index, transform, box in zip(self._frames, transforms, self._outlines(), strict=True):
            if self._model.frames[index].parentJoint == 0 and len(box):
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


class Scene:
    """A stage with one robot on it, drawn into a window.

    Methods may be called from any one thread at a time; the page follows at once.

    Args:
        robot: the robot; it is drawn at its zero position, moved into the limits.
        window: where to draw; a new window when ``None``.

    Attributes:
        window: the window; ``arm3dof.ui.server.serve(scene.window)`` shows it in a browser.
        drawing: the nodes and shapes of the robot.
        name: the robot's name.
    """

    def __init__(self, robot: Robot, window: MeshcatWindow | None = None) -> None:
        self.window = window or MeshcatWindow()
        self.drawing = RobotDrawing(robot)
        self.name = robot.name
        self._robot = robot
        self._ghost: RobotDrawing | None = None
        self._floor = self.drawing.floor()
        self._replays = False
        start = np.clip(np.zeros(robot.nv), robot.limits.q_min, robot.limits.q_max)
        self._radius = self.look_at(start[None])
        self.window.post(
            *self.drawing.objects(), *self.drawing.poses(start), caption_command(robot.name)
        )

    def display(self, q: ArrayLike) -> None:
        """Show the robot at a configuration; a replay that is shown ends.

        Args:
            q: joint positions, shape (nv,) [rad].

        Raises:
            InputError: ``q`` has another shape.
        """
        commands = self.drawing.poses(frozen_array(q, self._robot.nv, name="q"))
        if self._replays:
            self._replays = False
            commands.insert(0, no_replay())
        self.window.post(*commands)

    def show_ghost(self, q: ArrayLike) -> None:
        """Show a see-through copy of the robot, for example at the target.

        Args:
            q: joint positions, shape (nv,) [rad].

        Raises:
            InputError: ``q`` has another shape.
        """
        q = frozen_array(q, self._robot.nv, name="q")
        if self._ghost is None:
            self._ghost = RobotDrawing(self._robot, "/ghost", GHOST)
            self.window.post(*self._ghost.objects())
        self.window.post(*self._ghost.poses(q))

    def hide_ghost(self) -> None:
        """Take the see-through copy away."""
        self._ghost = None
        self.window.post(shapes.delete("/ghost"))

    def show_target(self, point: ArrayLike) -> None:
        """Mark a point: a ball in a ring, and a stalk down to the floor.

        Args:
            point: the point in the base frame, shape (3,) [m].

        Raises:
            InputError: the point has another shape.
        """
        p = frozen_array(point, 3, name="point")
        size = 0.045 * self._radius
        glow = shapes.material((*TARGET, 0.32), "Basic")
        solid = shapes.material(TARGET, "Basic")
        commands = [
            shapes.draw("/target/glow", shapes.sphere(size), glow),
            shapes.draw("/target/core", shapes.sphere(0.35 * size), solid),
            shapes.draw("/target/ring", shapes.torus(1.5 * size, 0.07 * size), solid),
            shapes.draw("/target/foot", shapes.torus(1.5 * size, 0.05 * size), glow),
            shapes.move("/target/foot", (0, 0, self._floor + 0.1 * size - p[2])),
            shapes.move("/target", p),
        ]
        height = p[2] - self._floor
        if height > size:
            stalk = shapes.cylinder(0.05 * size, height - size)
            commands.append(shapes.draw("/target/stalk", stalk, glow))
            commands.append(shapes.move("/target/stalk", (0, 0, -(height + size) / 2)))
        commands += [
            shapes.set_property(f"/target/{part}/<object>", "castShadow", False)
            for part in ("glow", "ring", "foot")
        ]
        self.window.post(shapes.delete("/target"), *commands)

    def show_path(self, points: ArrayLike) -> None:
        """Draw a path as a thin tube, light at its start and dark at its end.

        Args:
            points: points in the base frame, shape (n, 3) [m].

        Raises:
            InputError: the points have another shape.
        """
        shape = tube(
            frozen_array(points, None, 3, name="points"),
            0.009 * self._radius,
            PATH_START,
            PATH_END,
        )
        commands = [shapes.delete("/path")]
        if shape is not None:
            look = shapes.material((1, 1, 1), "Basic", vertexColors=True)
            commands.append(shapes.draw("/path", shape, look))
            commands.append(shapes.set_property("/path/<object>", "castShadow", False))
        self.window.post(*commands)

    def show_recording(self, recording: Recording) -> None:
        """Play a recording in a loop, with its target, the tool's path and its verdict.

        Where it tells of a gripper and of objects, the fingers and the objects move too.

        Args:
            recording: a run of this robot.
        """
        robot = recording.load_robot()
        sample = sample_rows(recording.q, 400)
        self._radius = self.look_at(np.vstack([sample[::10], recording.q_target]))
        path = [robot.placement(q).translation for q in sample]
        self.show_path(np.array(path).reshape(-1, 3))
        self._replays = True
        if recording.world is None:
            self.show_target(robot.placement(recording.q_target).translation)
        else:  # what is aimed at moves, and is drawn itself
            self.window.post(*draw_world(recording.world))
        self.window.post(
            caption_command(robot.name, recording, summarise(recording)),
            replay_command(recording, robot, self.drawing),
        )

    def look_at(self, configurations: Array) -> float:
        """Set stage and camera around the robot; return the radius of what is shown [m].

        Args:
            configurations: joint positions at which all of it is to be seen, shape (n, nv) [rad].
        """
        center, radius = self.drawing.enclosing_ball(configurations)
        self.window.post(*stage_commands(center, radius, self._floor), view_command(center, radius))
        return radius


def recording_scene(recording: Recording, window: MeshcatWindow | None = None) -> Scene:
    """Return a scene that plays a recording.

    Args:
        recording: the run.
        window: where to draw; a new window when ``None``.
    """
    scene = Scene(recording.load_robot(), window)
    scene.show_recording(recording)
    return scene

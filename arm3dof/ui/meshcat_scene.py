"""A robot, its target and its path on a page: what is drawn, and what moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array, frozen_array
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_window import MeshcatWindow
from arm3dof.ui.replay import caption_command, no_replay, replay_command, sample_rows
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.stage import stage_commands, view_command
from arm3dof.ui.things import draw_world
from arm3dof.ui.tube import tube

TARGET = (0.902, 0.376, 0.0)
PATH_START, PATH_END = (0.337, 0.706, 0.914), (0.0, 0.447, 0.698)
GHOST = (0.0, 0.447, 0.698, 0.22)


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

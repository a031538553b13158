"""The 3-D view of the live arm: where it is, where it is going, and what pulls at it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm3dof.model.robot import Robot
from arm3dof.runtime.live.frames import Frames
from arm3dof.sim.world import COLOURS, World
from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_scene import GHOST, Scene
from arm3dof.ui.meshcat_window import Command, MeshcatWindow
from arm3dof.ui.studio.ghost import Ghost, link_meshes
from arm3dof.ui.style import COLORS
from arm3dof.ui.things import body_poses, draw_world
from arm3dof.vision.camera import Camera
from arm3dof.vision.locate import Located

_BAR = 0.10  # length of a bar at the torque limit [m]
_TRAIL = 240  # points of the tool's path that are drawn
_STRIDE = 0.002  # the tool moves as far before its path grows [m]
_UNNAMED = (0.55, 0.36, 0.64)  # colour of a thing whose name is no colour
_FRUSTUM = 0.10  # how far the camera's view is drawn [m]
_CLOUD = 6000  # samples of the reachable region
_ASIDE = 1.3  # [rad]: the view holds the arm stretched out to each side
_VISIBLE = 1e-4  # [rad, m]: what moved less looks the same, and its picture may rest
_SAME = 1e-10  # [rad, m]: but in the end all is where it is, to the last digits
# frames after which a change that nobody sees is drawn as well: 3 s, and from then on ever rarer
_SETTLED = 100
_AHEAD = (GHOST[:3], (0.10, 0.20))  # colour of the plan's ghosts, and their opacities
_NEAR = 0.02  # [rad]: a plan that leads no farther is not worth a ghost
_WXYZ = (0, 1, 2, 4, 5, 6, 3)  # MuJoCo's order of a pose, to Pinocchio's


class LiveScene:
    """Draws frames into a window; use it from one thread.

    Attributes:
        window: the window.
    """

    def __init__(
        self,
        robot: Robot,
        home: Array,
        camera: Camera | None = None,
        world: World | None = None,
    ) -> None:
        """Create the scene.

        Args:
            robot: the arm.
            home: where it begins; the view is set to it, shape (nv,) [rad].
            camera: the camera, drawn where it stands.
            world: what stands around the arm.
        """
        self.window = MeshcatWindow()
        self._home, self._camera, self._world = home, camera, world or World()
        self._trail: list[Array] = []
        self._run = -1
        self.change_robot(robot)

    def change_robot(self, robot: Robot) -> None:
        """Draw another arm in place of the one before."""
        self._robot = robot.clone()
        self.window.post(*(shapes.delete(path) for path in ("/robot", "/ghost", "/plan", "/bars")))
        self._scene = Scene(self._robot, self.window)
        stretched = np.clip(np.zeros(robot.nv), robot.limits.q_min, robot.limits.q_max)
        aside = [stretched + turn * np.eye(robot.nv)[0] for turn in (-_ASIDE, _ASIDE)]
        poses = np.clip([self._home, stretched, *aside], robot.limits.q_min, robot.limits.q_max)
        self._scene.look_at(poses)
        self._arm, self._things, self._ahead = _Shown(), _Shown(), _Shown()
        self._q_target: Array | None = None
        drawing = self._scene.drawing
        self._target = Ghost(drawing, "/ghost", GHOST)
        color, opacities = _AHEAD
        self._plan = [
            Ghost(drawing, f"/plan/{k}", (*color, opacity)) for k, opacity in enumerate(opacities)
        ]
        self._plans: bool | None = None
        meshes = link_meshes(drawing)
        for ghost in (self._target, *self._plan):
            self.window.post(*ghost.objects(meshes))
        self.window.post(*self._bars(), *draw_world(self._world))
        if self._camera is not None:
            self.window.post(*_frustum(self._camera))

    def show(self, frame: Frames) -> None:
        """Show one frame."""
        if self._arm.differs(np.append(frame["q"], frame["opening"])):
            self._show_arm(frame)
        if self._things.differs(frame["bodies"]):
            names = (body.name for body in self._world.bodies)
            rows = frame["bodies"][:, _WXYZ]
            self.window.post(*body_poses(dict(zip(names, rows, strict=True))))
        if self._q_target is None or not np.array_equal(self._q_target, frame["q_target"]):
            self._q_target = np.array(frame["q_target"])
            self.window.post(*self._target.poses(self._q_target))
            self._scene.show_target(self._robot.placement(self._q_target).translation)
        self._show_plan(frame)

    def _show_arm(self, frame: Frames) -> None:
        drawing, opening = self._scene.drawing, float(frame["opening"])
        places = drawing.placements(frame["q"], None if np.isnan(opening) else opening)
        links = zip(drawing.link_names, places, strict=True)
        self.window.post(
            *(shapes.pose(drawing.node(name), place) for name, place in links),
            *self._bar_poses(frame),
        )

    def _show_plan(self, frame: Frames) -> None:
        """Draw where the controller expects the arm halfway and at its horizon, while it moves."""
        rows = int(frame["plan_rows"])
        end = frame["plan_q"][rows - 1]
        plans = rows > 1 and bool(np.abs(end - frame["q"]).max() > _NEAR)
        if plans != self._plans:
            self._plans = plans
            self.window.post(self._target.seen(not plans), *(it.seen(plans) for it in self._plan))
        if plans and self._ahead.differs(end):
            stages = (frame["plan_q"][rows // 2], end)
            for ghost, q in zip(self._plan, stages, strict=True):
                self.window.post(*ghost.poses(q))

    def show_trail(self, frames: Frames) -> None:
        """Draw the tool's path of the present run further, through new frames, shape (n,)."""
        before = len(self._trail)
        for frame in frames:
            if frame["run"] != self._run:
                self._run, self._trail, before = int(frame["run"]), [], -1
            tool = np.array(frame["tool"])
            if not self._trail or np.linalg.norm(tool - self._trail[-1]) > _STRIDE:
                self._trail.append(tool)
        if len(self._trail) != before:
            self._trail = self._trail[-_TRAIL:]
            self._scene.show_path(np.array(self._trail))

    def show_objects(self, located: Sequence[Located]) -> None:
        """Draw what the eye has located, with how far off it may be; not where all is known."""
        if self._world.bodies:
            return
        self.window.post(shapes.delete("/seen"))
        for number, found in enumerate(located):
            spread, axes = np.linalg.eigh(found.covariance_base)
            transform = np.eye(4)
            turn = axes * np.sign(np.linalg.det(axes))
            transform[:3, :3] = turn * (2 * np.sqrt(np.maximum(spread, 1e-8)) + 0.002)
            transform[:3, 3] = found.p_base
            path = f"/seen/{number}"
            colour = COLOURS.get(found.target, _UNNAMED)
            look = shapes.material((*colour, 0.85), "Phong")
            self.window.post(
                shapes.draw(path, shapes.sphere(1.0), look), shapes.pose(path, transform)
            )

    def show_region(self, shown: bool) -> None:
        """Draw, or hide, where the tool can be inside the joint limits."""
        self.window.post(shapes.delete("/region"))
        if shown:
            self.window.post(*_region(self._robot))

    def _bars(self) -> list[Command]:
        commands = []
        for joint in range(self._robot.nv):
            look = shapes.material((*_rgb(COLORS[joint % len(COLORS)]), 0.9), "Basic")
            path = f"/bars/{joint}"
            commands += [
                shapes.draw(path, shapes.cylinder(0.004, 1.0), look),
                shapes.set_property(f"{path}/<object>", "castShadow", False),
            ]
        return commands

    def _bar_poses(self, frame: Frames) -> list[Command]:
        """Return where the bars stand: at their joints, as long as gravity's share of the limit."""
        share = np.abs(frame["gravity"]) / self._robot.limits.tau_max
        commands = []
        for joint, name in enumerate(self._robot.joint_names):
            length = max(_BAR * min(float(share[joint]), 1.2), 1e-4)
            transform = np.diag([1.0, 1.0, length, 1.0])
            transform[:3, 3] = self._robot.placement(frame["q"], name).translation
            transform[2, 3] += 0.03 + length / 2
            transform[1, 3] += 0.022 * (joint - 1)
            commands.append(shapes.pose(f"/bars/{joint}", transform))
        return commands


class _Shown:
    """What was drawn last, to tell whether there is anything new to be seen."""

    def __init__(self) -> None:
        self._values: Array | None = None
        self._since, self._patience = 0, _SETTLED

    def differs(self, values: Array) -> bool:
        """Return whether values are to be drawn, which are then the ones that were."""
        new = np.nan_to_num(values)
        self._since += 1
        if self._values is not None and new.size:
            change = float(np.abs(new - self._values).max())
            settles = self._since > self._patience
            if change <= (_SAME if settles else _VISIBLE):
                return False
            self._patience = 2 * self._patience if settles and change <= _VISIBLE else _SETTLED
        elif self._values is not None:
            return False
        self._values, self._since = np.array(new), 0
        return True


def _frustum(camera: Camera) -> list[Command]:
    """Return lines from the lens through the picture's corners."""
    right, bottom = camera.width - 0.5, camera.height - 0.5
    corners = np.array([(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)])
    ends = camera.deproject(corners, np.full(4, _FRUSTUM))
    eye = np.tile(camera.position, (4, 1))
    lines = np.concatenate(
        [
            np.stack([eye, ends], axis=1).reshape(-1, 3),
            np.stack([ends, np.roll(ends, -1, axis=0)], axis=1).reshape(-1, 3),
        ]
    )
    look = shapes.line_material((0.25, 0.30, 0.36))
    return [
        shapes.draw("/camera/frustum", shapes.triangles(lines), look, "LineSegments"),
        shapes.draw("/camera/lens", shapes.sphere(0.008), shapes.material((0.15, 0.17, 0.2))),
        shapes.move("/camera/lens", camera.position),
    ]


def _region(robot: Robot) -> list[Command]:
    """Return small marks where the tool is at sampled positions, coloured by height."""
    rng = np.random.default_rng(0)
    points = np.array(
        [robot.placement(robot.random_configuration(rng)).translation for _ in range(_CLOUD)]
    )
    size = 0.0022
    arms = size * np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
    marks = (points[:, None] + arms).reshape(-1, 3)
    height = (points[:, 2] - points[:, 2].min()) / max(float(np.ptp(points[:, 2])), 1e-9)
    low, high = np.array(_rgb(COLORS[5])), np.array(_rgb(COLORS[0]))
    colours = np.repeat(low + (high - low) * (1 - height[:, None]), 6, axis=0)
    look = shapes.line_material((1, 1, 1, 0.55), vertexColors=True)
    cloud = shapes.triangles(marks, colors=colours)
    return [shapes.draw("/region", cloud, look, "LineSegments")]


def _rgb(code: str) -> tuple[float, float, float]:
    red, green, blue = (int(code[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue

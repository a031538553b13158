"""A run frame by frame, drawn without a browser: the arm, its target, torques and time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from arm3dof.files import write_atomically
from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from arm3dof.ui import stage
from arm3dof.ui.facets import Facets, Piece, facets
from arm3dof.ui.meshcat_scene import PATH_END, TARGET
from arm3dof.ui.painter import Canvas, Perspective, Picture
from arm3dof.ui.replay import at_times, is_good, is_turning, sample_rows, verdict
from arm3dof.ui.report_data import status_segments, task_phases
from arm3dof.ui.run_stage import RunStage
from arm3dof.ui.shapes import sphere
from arm3dof.ui.style import COLORS, INK, SOFT

FPS = 25.0
SIZE = (1280, 720)  # width, height [px]
_FINE = 2  # pixels painted per pixel shown, along each side
_LEVELS = ("#0072B2", "#B58900", "#D55E00", "#B3123F")  # of status_segments
MAX_PATH = 4000  # points that the tool's path is known at
PATH_TIME = 4.0  # s of the tool's path that are shown
_HOLD = 1.0  # s for which the last frame stays


class RunPainter:
    """Draws a run at any moment.

    Args:
        recording: the run.
        size: width and height of the pictures [px].
    """

    def __init__(self, recording: Recording, size: tuple[int, int] = SIZE) -> None:
        self._run = recording
        self._size = size
        self._stage = RunStage(recording)
        robot = recording.load_robot()
        self._path_times = sample_rows(recording.t[:, None], MAX_PATH)[:, 0]
        path = [robot.placement(q).translation for q in sample_rows(recording.q, MAX_PATH)]
        self._path = np.array(path).reshape(-1, 3)
        self._robot = robot
        poses = np.vstack([sample_rows(recording.q, 40), recording.q_target])
        center, radius = self._stage.drawing.enclosing_ball(poses)
        target = robot.placement(recording.q_target).translation
        self._mark = _ball(target, 0.03 * radius)
        self._line_width = 0.006 * size[1] * _FINE
        self._view = _view(center, radius, size)
        self._empty = _backdrop(self._view, size, center, radius, self._stage.floor)
        self._overlay = _Overlay(recording, robot, size)

    def at(self, t: float) -> Picture:
        """Draw the run at a time.

        Args:
            t: time since the start [s].

        Returns:
            BGR picture, shape (height, width, 3), uint8.
        """
        r = self._run
        now = float(r.t[0]) + t
        q, points = self._stage.joints(now), self._stage.points(now)
        canvas = Canvas(self._empty, self._view)
        canvas.cast_shadow(self._stage.shape, points, self._stage.floor)
        canvas.paint(self._stage.shape, points)
        if r.world is None:  # else the target is one of many places on the way
            shape, place = self._mark
            canvas.paint(shape, shape.placed(place))
        canvas.line(self._path_until(now, q), PATH_END, self._line_width)
        picture = cv2.resize(canvas.picture, self._size, interpolation=cv2.INTER_AREA)
        return self._overlay.onto(picture, t, q, at_times(r, r.tau, np.array([now]))[0])

    def _path_until(self, now: float, q: Array) -> Array:
        """Return the tool's path of the last seconds."""
        shown = (self._path_times < now) & (self._path_times > now - PATH_TIME)
        tool = self._robot.placement(q).translation
        return np.vstack([sample_rows(self._path[shown], 150), tool])


def run_frames(
    recording: Recording, fps: float = FPS, size: tuple[int, int] = SIZE
) -> Iterator[Picture]:
    """Draw a run in real time; its last moment stays for a second.

    Args:
        recording: the run.
        fps: frames per second.
        size: width and height of the pictures [px].

    Yields:
        BGR pictures, shape (height, width, 3), uint8; ``frame_count`` of them.
    """
    painter = RunPainter(recording, size)
    duration = float(recording.t[-1] - recording.t[0])
    moving = int(np.floor(duration * fps)) + 1
    for number in range(moving):
        yield painter.at(number / fps)
    last = painter.at(duration)
    for _ in range(frame_count(recording, fps) - moving):
        yield last


def frame_count(recording: Recording, fps: float = FPS) -> int:
    """Return how many frames ``run_frames`` yields."""
    duration = float(recording.t[-1] - recording.t[0])
    return int(np.floor(duration * fps)) + 1 + round(_HOLD * fps)


def save_stills(recording: Recording, folder: str | Path) -> tuple[Path, ...]:
    """Write the first and the last pose as PNG files (the paper's figures 13 and 14).

    Args:
        recording: the run.
        folder: where to; it is made when it does not exist.

    Returns:
        The paths: start, end.

    Raises:
        InputError: the folder cannot be written.
    """
    painter = RunPainter(recording)
    duration = float(recording.t[-1] - recording.t[0])
    paths = []
    for name, t in (("start", 0.0), ("end", duration)):
        _, data = cv2.imencode(".png", painter.at(t))
        paths.append(Path(folder) / f"{name}.png")
        write_atomically(paths[-1], data.tobytes())
    return tuple(paths)


# ---- what rests --------------------------------------------------------------------------------


def _view(center: Array, radius: float, size: tuple[int, int]) -> Perspective:
    """Return the first view of the page, a little to the right to leave room for the figures."""
    width, height = _FINE * size[0], _FINE * size[1]
    direction = np.array(stage.VIEW_DIRECTIONS["Corner"])
    distance = 1.06 * radius / np.sin(stage.HALF_FIELD_OF_VIEW)
    eye = center + distance * direction / np.linalg.norm(direction)
    focal = min(height, 0.8 * width) / 2 / np.tan(stage.HALF_FIELD_OF_VIEW)
    return Perspective.look_at(eye, center, focal, (0.57 * width, 0.48 * height))


def _backdrop(
    view: Perspective, size: tuple[int, int], center: Array, radius: float, floor: float
) -> Picture:
    """Return the sky and the floor with lines at round distances, which fade away."""
    width, height = _FINE * size[0], _FINE * size[1]
    share = np.linspace(0, 1, height)[:, None, None]
    sky, ground = (255 * np.array(tone[::-1]) for tone in (stage.SKY, stage.GROUND))
    picture: NDArray[np.float32] = np.broadcast_to(
        sky + share * (0.55 * ground + 0.45 * sky - sky), (height, width, 3)
    ).astype(np.float32)
    lines = np.zeros((height, width), np.uint8)
    middle = np.array([center[0], center[1], floor])
    for start, end, strength in _grid_lines(middle, 3.0 * radius, stage.grid_step(radius)):
        (u0, v0), (u1, v1) = np.rint(view.project(np.array([start, end])) * 16).astype(int).tolist()
        cv2.line(lines, (u0, v0), (u1, v1), 255 * strength, 2, cv2.LINE_AA, 4)
    tone = 255 * np.array(stage.GRID_LINE[::-1], np.float32)
    picture += lines[..., None] * np.float32(1 / 255) * (tone - picture)
    result: Picture = np.clip(picture + 0.5, 0, 255).astype(np.uint8)
    return result


def _grid_lines(middle: Array, radius: float, step: float) -> Iterator[tuple[Array, Array, float]]:
    pieces = 8
    for axis in (0, 1):
        first = np.ceil((middle[axis] - radius) / step) * step
        for at in np.arange(first, middle[axis] + radius, step):
            half = np.sqrt(max(0.0, radius**2 - (at - middle[axis]) ** 2))
            along = middle[1 - axis] + np.linspace(-half, half, pieces + 1)
            points = np.tile(middle, (pieces + 1, 1))
            points[:, axis], points[:, 1 - axis] = at, along
            for start, end in itertools.pairwise(points):
                away = float(np.linalg.norm((start + end) / 2 - middle)) / radius
                yield start, end, 0.5 * max(0.0, 1 - away) ** 1.4


def _ball(center: Array, radius: float) -> tuple[Facets, Array]:
    place = np.eye(4)
    place[:3, 3] = center
    return facets([Piece(0, sphere(radius), np.eye(4), TARGET)]), place[None]


# ---- words and figures ---------------------------------------------------------------------------


class _Overlay:
    """Name, verdict, joints with their torques, and the time line."""

    def __init__(self, recording: Recording, robot: Robot, size: tuple[int, int]) -> None:
        self._run = recording
        self._turns = [is_turning(robot, joint) for joint in range(robot.nv)]
        self._width, self._height = size
        self._unit = size[1] / 720
        self._font, self._small, self._bold = (
            self._face(17),
            self._face(14),
            self._face(24, "-Bold"),
        )
        self._duration = float(recording.t[-1] - recording.t[0])
        self._segments = [each for each in status_segments(recording) if each.level]
        metrics = summarise(recording)
        self._good = is_good(recording, metrics)
        self._verdict = verdict(recording, metrics)
        self._name = robot.name
        self._done = metrics.settling_time if metrics.settling_time is not None else self._duration
        self._phases = task_phases(recording)
        if self._phases:
            self._done = min(self._phases[-1].end, self._duration)

    def onto(self, picture: Picture, t: float, q: Array, tau: Array) -> Picture:
        """Return a picture with the figures of one moment."""
        image = Image.fromarray(np.ascontiguousarray(picture[..., ::-1]))
        pen = ImageDraw.Draw(image, "RGBA")
        self._headline(pen, t)
        self._joints(pen, q, tau)
        self._time_line(pen, t)
        return np.ascontiguousarray(np.asarray(image)[..., ::-1])

    def _headline(self, pen: ImageDraw.ImageDraw, t: float) -> None:
        pen.text(self._at(32, 26), self._name, INK, self._bold)
        if t >= self._done - 1e-9:
            color = "#00694E" if self._good else "#8F3D00"
            pen.text(self._at(32, 62), self._verdict, color, self._font)
            return
        for phase in self._phases:
            if phase.start <= t < phase.end:
                pen.text(self._at(32, 62), phase.name, SOFT, self._font)

    def _joints(self, pen: ImageDraw.ImageDraw, q: Array, tau: Array) -> None:
        r = self._run
        rows = len(r.joint_names)
        top = 626 - 28 * rows
        self._card(pen, 20, top - 34, 408, 640)
        for x, text in ((34, "joint"), (128, "angle"), (208, "torque / limit")):
            pen.text(self._at(x, top - 26), text, SOFT, self._small)
        for k, name in enumerate(r.joint_names):
            y = top + 28 * k
            pen.text(self._at(34, y), name[:11], INK, self._font)
            angle = f"{np.rad2deg(q[k]):.1f}°" if self._turns[k] else f"{1000 * q[k]:.1f} mm"
            self._right(pen, 192, y, angle)
            limit = float(r.limits.tau_max[k])
            share = float(np.clip(tau[k] / limit, -1, 1)) if np.isfinite(limit) else 0.0
            pen.rounded_rectangle([*self._at(208, y + 7), *self._at(308, y + 16)], 4, "#D5DCE4")
            left, right = sorted((258.0, 258 + 50 * share))
            color = "#D55E00" if abs(share) > 0.95 else COLORS[0]
            pen.rectangle([*self._at(left, y + 7), *self._at(right, y + 16)], color)
            pen.line(
                [*self._at(258, y + 5), *self._at(258, y + 18)], SOFT, max(1, round(self._unit))
            )
            unit = "N m" if self._turns[k] else "N"
            self._right(pen, 398, y, f"{tau[k]:.2f} {unit}".replace("-0.00", "0.00"))

    def _time_line(self, pen: ImageDraw.ImageDraw, t: float) -> None:
        wide = self._width / self._unit
        left, right, y = 34.0, wide - 190, 682
        self._card(pen, 20, y - 22, wide - 20, y + 22)
        span = (right - left) / (self._duration or 1.0)
        pen.rounded_rectangle([*self._at(left, y - 3), *self._at(right, y + 3)], 3, "#D5DCE4")
        for each in self._segments:
            ends = left + span * each.start, left + span * each.end
            box = [*self._at(ends[0], y + 6), *self._at(max(ends[1], ends[0] + 2), y + 10)]
            pen.rectangle(box, _LEVELS[each.level])
        now = left + span * min(t, self._duration)
        pen.rounded_rectangle([*self._at(left, y - 3), *self._at(now, y + 3)], 3, COLORS[0])
        pen.ellipse([*self._at(now - 7, y - 7), *self._at(now + 7, y + 7)], COLORS[0])
        self._right(pen, wide - 36, y - 11, f"{t:.2f} / {self._duration:.2f} s")

    def _card(self, pen: ImageDraw.ImageDraw, x0: float, y0: float, x1: float, y1: float) -> None:
        box = [*self._at(x0, y0), *self._at(x1, y1)]
        pen.rounded_rectangle(box, 12 * self._unit, (255, 255, 255, 225), (24, 34, 47, 26))

    def _right(self, pen: ImageDraw.ImageDraw, x: float, y: float, text: str) -> None:
        pen.text(self._at(x, y), text, INK, self._font, anchor="ra")

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return x * self._unit, y * self._unit

    def _face(self, size: float, kind: str = "") -> ImageFont.FreeTypeFont:
        path = Path(mpl.get_data_path()) / "fonts" / "ttf" / f"DejaVuSans{kind}.ttf"
        return ImageFont.truetype(str(path), size * self._unit)

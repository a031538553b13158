"""What stands behind the page: the arm, the eye, the 3-D view and what every tab is told."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from starlette.routing import BaseRoute, Mount, WebSocketRoute

from arm3dof.errors import ArmError, InputError
from arm3dof.model.gripper import Gripper, find_gripper
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.child import CONTEXT
from arm3dof.runtime.live.eye import Blind, Learned, Pick, SeenPicture, Watch
from arm3dof.runtime.live.eye_process import EyeProcess, EyeSpec
from arm3dof.runtime.live.frames import Frames, Mode
from arm3dof.runtime.live.mind_process import MindProcess
from arm3dof.runtime.live.pace import lateness_percentiles
from arm3dof.runtime.live.process import ArmProcess, ArmSpec, News
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.sim.world import World
from arm3dof.ui.broadcast import Broadcast
from arm3dof.ui.report import write_report
from arm3dof.ui.studio import feed
from arm3dof.ui.studio.controls import Controls
from arm3dof.ui.studio.fields import control_changes
from arm3dof.ui.studio.keep import Runs, free_name, write_into
from arm3dof.ui.studio.scene import LiveScene
from arm3dof.ui.studio.start import free_place
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget
from arm3dof.vision.locate import Located

_LOGGER = logging.getLogger(__name__)
VIEW_RATE = 42.0
"""How often the 3-D view is moved [1/s]; the charts get half of it."""
_TRAIL_RATE = 5.0  # [1/s]
_LATENESS_KEPT = 3600  # wake-ups, a minute of them
_NEWS_KEPT = 50
_CAMERA_FILE, _SETTINGS_FILE = "camera.toml", "studio.toml"
_EYE_ENDED = "what looks through the camera has ended; start the program again"
_BROKEN = "the page can show nothing more, for it failed inside; start the program again"
_LOST = "the tab that held the controls is gone, so the arm was stopped"


class Store(Protocol):
    """Writes and reads settings files, which the page itself does not know."""

    def save_targets(self, path: Path, camera: Camera, targets: Sequence[ColourTarget]) -> Path:
        """Write what a camera looks for as a CAMERA.toml, and return its path."""

    def load_targets(self, path: Path) -> tuple[ColourTarget, ...]:
        """Return the targets of a CAMERA.toml."""

    def save_tuned(self, path: Path, tuned: Tuned) -> Path:
        """Write what was tuned as a STUDIO.toml, and return its path."""

    def load_tuned(self, path: Path) -> Tuned:
        """Return what a STUDIO.toml says."""


class Studio:
    """Runs the arm and the eye in their processes and tells the page what they do.

    Attributes:
        robot: the arm as it is now.
        tuned: its parameters and its controller.
        out: the only folder that is written to.
        arm: the arm's process.
        eye: the eye's process.
        scene: the 3-D view.
        controls: who holds the controls.
        sight: the last picture; ``None`` before the first, and while there are none.
        blind: why there are no pictures; empty while there are.
        learned: the last colour that was learned by a click.
        news: what happened, newest last, each with its number.
    """

    def __init__(
        self,
        tuned: Tuned,
        robot: Robot,
        start: ArrayLike,
        eye: EyeSpec,
        out: Path,
        store: Store,
    ) -> None:
        """Start the processes; ``close`` ends them.

        Args:
            tuned: the arm's parameters and its controller.
            robot: the arm that ``tuned`` describes.
            start: joint positions to begin at, shape (nv,) [rad].
            eye: what the eye looks through.
            out: the folder that files are written to.
            store: writes and reads settings files.
        """
        self.tuned, self.robot, self.out = tuned, robot, out
        self.news: deque[tuple[int, News]] = deque(maxlen=_NEWS_KEPT)
        self.sight: SeenPicture | None = None
        self.blind = ""
        self.learned: Learned | None = None
        self.watch = eye.watch
        self.chosen = eye.watch.targets[0].name if eye.watch.targets else ""
        self.camera, self._store = eye.camera, store
        self.runs = Runs()
        self._numbered = 0
        self._failure = b""
        self.live = Broadcast(lambda: self._failure)  # the eye's first picture may come soon
        packed = PackedRobot.of(robot)
        has_physics = isinstance(eye.source, World)
        self.gripper: Gripper | None = find_gripper(robot) if has_physics else None
        world = eye.source if isinstance(eye.source, World) else None
        position = tuple(np.asarray(start, float).tolist())
        ear, mouth = CONTEXT.Pipe(duplex=False)
        asks, answers = CONTEXT.Pipe()
        spec = ArmSpec(packed, position, tuned.control, world)
        self.arm = ArmProcess(spec, self._hear, ear, asks)
        self.eye = EyeProcess(eye, packed, self.arm.ring, self._see, mouth)
        for end in (ear, mouth, asks):
            end.close()
        self._answers = answers
        self._mind: MindProcess | None = None
        self.scene = LiveScene(robot, np.array(position), eye.camera, world)
        self.controls = Controls(self._lost)
        self._version = 0
        self._scene_lock = threading.Lock()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._show, name="arm3dof-studio", daemon=True)

    # ---- what the page asks for --------------------------------------------------------------

    def ask(self, command: cmd.Command) -> None:
        """Send a command to the arm.

        Raises:
            ArmError: its process has ended.
        """
        self.arm.send(command)
        if isinstance(command, cmd.Control):
            self.tuned = replace(self.tuned, control=command)

    def look_for(self, watch: Watch) -> None:
        """Let the eye look for other things.

        Raises:
            ArmError: its process has ended.
        """
        self.eye.send(watch)
        self.watch = watch

    def pick(self, pick: Pick) -> None:
        """Let the eye learn the colour at a pixel; ``learned`` will have it."""
        self.eye.send(pick)

    def rebuild(self, overrides: Mapping[str, float], servo: str = "") -> None:
        """Change the arm's parameters: rebuild it, draw it, and go on with it.

        Args:
            overrides: URDF parameters that differ from its file, SI units.
            servo: the servo in every joint; empty for the URDF's own limits.

        Raises:
            ArmError: a parameter is impossible; everything stays as it is.
        """
        robot = replace(self.tuned, overrides=dict(overrides), servo=servo).load_robot()
        self._version += 1
        packed = PackedRobot.of(robot)
        self.arm.send(cmd.Rebuild(packed, self._version))
        with contextlib.suppress(ArmError):  # an arm goes on without an eye
            self.eye.send(packed)
        with self._scene_lock:
            self.robot = robot
            self.tuned = replace(self.tuned, overrides=dict(overrides), servo=servo)
            self.scene.change_robot(robot)

    def show_region(self, shown: bool) -> None:
        """Draw or hide the reachable region."""
        with self._scene_lock:
            self.scene.show_region(shown)

    def grasp(self, name: str = "") -> None:
        """Let the arm grasp an object and put it down a little to the side.

        Args:
            name: which kind of object; the nearest that is seen when empty.

        Raises:
            InputError: no such object is seen on the table.
        """
        seen = [it for it in self.located() if name in ("", it.target)]
        if not seen:
            raise InputError(f"no {name or 'known'} object is seen; choose what to look for")
        nearest = min(seen, key=lambda it: float(np.hypot(*it.p_base[:2])))
        x, y = nearest.p_base[:2].tolist()
        others = [it.p_base[:2] for it in self.located() if it is not nearest]
        self.ask(cmd.Do("grasp", nearest.target, free_place(x, y, others)))

    def alive(self) -> None:
        """Tell the arm that the page is there."""
        self.arm.send(cmd.Alive())

    def changes(self) -> list[str]:
        """Return what differs from how everything comes, one line each."""
        return [
            *control_changes(self.tuned.control),
            *([f"servos = {self.tuned.servo}"] if self.tuned.servo else []),
            *(f"{key} = {value:g}" for key, value in self.tuned.overrides.items()),
        ]

    def located(self) -> tuple[Located, ...]:
        """Return what the eye has located in the last picture."""
        return () if self.sight is None else self.sight.view.located

    def seen_at(self, u: int, v: int) -> Located | None:
        """Return what is at a pixel of the last picture."""
        for found in self.located():
            left, top, width, height = found.box_px
            if left <= u < left + width and top <= v < top + height:
                return found
        return None

    # ---- what is kept --------------------------------------------------------------------------

    def files(self) -> list[str]:
        """Return the names of the files in the folder."""
        return sorted(path.name for path in self.out.glob("*") if path.is_file())

    def save_run(self) -> Path:
        """Write the last run as a recording, and return where.

        Raises:
            InputError: there was no run, or the folder cannot be written.
        """
        recording = self.runs.recording(self.robot, self.tuned.control)
        return recording.save(self.out / free_name(self.out, "run", ".npz"))

    def save_report(self) -> Path:
        """Write the last run as one HTML file, and return where.

        Raises:
            InputError: there was no run, or the folder cannot be written.
        """
        recording = self.runs.recording(self.robot, self.tuned.control)
        picture = None if self.sight is None else self.sight.jpeg
        return write_report(recording, self.out / free_name(self.out, "report", ".html"), picture)

    def save_settings(self) -> Path:
        """Write what is tuned as TOML, and return where."""
        return self._store.save_tuned(self.out / _SETTINGS_FILE, self.tuned)

    def load_settings(self) -> None:
        """Tune as the folder's studio.toml says.

        Raises:
            ArmError: there is none, it is broken, or it is of another robot.
        """
        tuned = self._store.load_tuned(self.out / _SETTINGS_FILE)
        if tuned.source != self.tuned.source:
            raise InputError(
                f"{_SETTINGS_FILE} is of the robot {tuned.source}, and this is "
                f"{self.tuned.source}; start with: arm3dof studio --settings {_SETTINGS_FILE}"
            )
        self.rebuild(tuned.overrides, tuned.servo)
        self.ask(tuned.control)

    def save_urdf(self) -> Path:
        """Write the arm as it is now as a URDF, and return where."""
        return write_into(self.out, "arm.urdf", self.robot.description.urdf.encode())

    def save_targets(self) -> Path:
        """Write what the eye looks for as a CAMERA.toml, and return where."""
        return self._store.save_targets(self.out / _CAMERA_FILE, self.camera, self.watch.targets)

    def load_targets(self) -> None:
        """Look for what the folder's CAMERA.toml says.

        Raises:
            ArmError: there is none, or it is broken.
        """
        targets = self._store.load_targets(self.out / _CAMERA_FILE)
        self.chosen = targets[0].name if targets else ""
        self.look_for(replace(self.watch, targets=targets, shown=""))

    # ---- the server's side ---------------------------------------------------------------------

    def begin(self) -> None:
        """Begin to show what there is to see; to be called once, by the server when it is up.

        Not sooner: as it starts, NiceGUI walks over all objects there are, and a tuple that another
        thread is just filling then can never be finished (a ``SystemError`` of CPython).
        """
        self._thread.start()

    def routes(self) -> list[BaseRoute]:
        """Return the routes of the 3-D view and of the numbers and pictures."""
        return [
            Mount("/3d", routes=self.scene.window.routes()),
            WebSocketRoute("/live", self.live.endpoint),
        ]

    def close(self) -> None:
        """End everything: the arm brakes first."""
        self._stopping.set()
        self.eye.ask_to_end()
        if self._thread.ident is not None:
            self._thread.join()
        self.arm.close()
        self.eye.close()
        if self._mind is not None:
            self._mind.close()

    # ---- what comes back -----------------------------------------------------------------------

    def _hear(self, news: News) -> None:
        self._numbered += 1
        self.news.append((self._numbered, news))

    def _see(self, message: SeenPicture | Learned | Blind) -> None:
        if isinstance(message, Blind):
            self._go_blind(message.why)
        elif isinstance(message, Learned):
            self.learned = message
        else:
            self.sight, self.blind = message, ""
            if message.mask:  # before its picture, with which it is shown or hidden
                self.live.send(feed.MASK + message.mask)
            self.live.send(feed.PICTURE + message.jpeg)

    def _go_blind(self, why: str) -> None:
        """Say that there are no pictures, and stop an arm that moves: nobody watches it."""
        self.sight, self.blind = None, why
        frame = self.arm.ring.latest()
        if frame is not None and frame["mode"] in (Mode.RUNNING, Mode.WORKING):
            why = f"{why}; the arm was stopped"
            with contextlib.suppress(ArmError):
                self.arm.send(cmd.Stop())
        self._hear(News(why, bad=True))

    def _lost(self) -> None:
        try:
            self.arm.send(cmd.Stop(_LOST))
        except ArmError as error:
            self._hear(News(str(error), bad=True))

    def _show(self) -> None:
        """Show what there is to see until the end; runs in a thread of its own.

        Should it fail, every tab is told so, those that come later as well, and the arm stops.
        """
        try:
            self._show_frames()
        except Exception:  # whatever it is: nobody else hears of what ends this thread
            _LOGGER.exception(_BROKEN)
            with self.live.changed:
                self._failure = feed.FAILURE + _BROKEN.encode()
                self.live.send(self._failure)
            self._hear(News(_BROKEN, bad=True))
            with contextlib.suppress(ArmError):
                self.arm.send(cmd.Stop())

    def _show_frames(self) -> None:
        """Move the 3-D view and feed the tabs."""
        count, due = 0, time.monotonic()
        known: tuple[object, ...] = ()
        seen: list[dict[str, object]] = []
        lateness: deque[float] = deque(maxlen=_LATENESS_KEPT)
        late = lateness_percentiles(np.zeros(0))
        pending: list[Frames] = []
        trail: list[Frames] = []
        turn = 0
        while not self._stopping.wait(max(due - time.monotonic(), 0.0)):
            if self._mind is None and self.sight is not None:  # the page comes before the tasks
                self._mind = MindProcess(self._answers, lambda message: None)
                self._answers.close()
            due = max(due + 1 / VIEW_RATE, time.monotonic())
            count, frames = self.arm.ring.since(count)
            if not len(frames):
                continue
            self.runs.add(frames)
            lateness.extend(frames["lateness"].tolist())
            pending.append(frames)
            trail.append(frames)
            turn += 1
            with self._scene_lock:
                self.scene.show(frames[-1])
                if turn % round(VIEW_RATE / _TRAIL_RATE) == 0:
                    if not (self.blind or self.eye.is_alive):
                        self._go_blind(_EYE_ENDED)
                    self.scene.show_trail(np.concatenate(trail))
                    trail = []
                    late = lateness_percentiles(np.array(lateness))
                    located, robot = self.located(), self.robot
                    key = robot, *((it.target, it.box_px, it.p_base.tobytes()) for it in located)
                    if key != known:
                        known = key
                        self.scene.show_objects(located)
                        seen = feed.seen(located, robot)
            if turn % 2 == 0:
                extra = {"holder": self.controls.holder, "tabs": self.controls.tabs, "seen": seen}
                message = feed.numbers_message(
                    np.concatenate(pending), self.robot, late, extra, self.blind
                )
                self.live.send(message)
                pending = []
